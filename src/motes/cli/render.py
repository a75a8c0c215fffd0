"""`motes render`: kept frames to a film, drawn again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motes.cli.options import components_option, film_options, set_option
from motes.cli.progress import shown


@click.command(short_help="Draw a film again from its kept frames.")
@click.argument("folder", type=click.Path(path_type=Path))
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Folder to write to; else FOLDER."
)
@components_option
@set_option
@film_options
def command(
    folder: Path,
    output: Path | None,
    assignments: tuple[tuple[str, Any], ...],
    frames: tuple[int, int | None],
    size: list[int] | None,
    form: str,
    threads: int | None,
    quiet: bool,
    verbose: bool,
) -> None:
    """Draw again from the frames that `motes run` has kept in FOLDER.

    Another size, camera, exposure or look needs no new simulation:
    motes render out --size 1920x1080 --set camera.field_of_view=30
    """
    import motes
    from motes.production import open_frames

    if threads is not None:
        motes.threads(threads)
    values = dict(assignments)
    if size is not None:
        values["film.size"] = size
    name = open_frames(folder).manifest.name
    with shown(name, quiet=quiet, verbose=verbose) as watch:
        made = motes.redraw(
            folder, values=values, first=frames[0], last=frames[1],
            output=output, form=form, watch=watch,
        )  # fmt: skip
    for path in made.paths():
        click.echo(path)
