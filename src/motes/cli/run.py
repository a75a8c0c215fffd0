"""`motes run`: a scene to a film."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motes.cli.options import components_option, film_options, scene_argument, scene_options
from motes.cli.progress import rounded, shown


@click.command(short_help="Simulate a scene and make its film.")
@scene_argument
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="Folder to write to; else ./NAME."
)
@components_option
@scene_options
@film_options
@click.option("--no-film", is_flag=True, help="Only simulate, and keep the frames.")
def command(scene: str, **options: Any) -> None:
    """Simulate SCENE, a name of the gallery or a file, and make its film.

    Writes NAME.mp4, NAME.png (contact sheet) and the folder frames, from which `motes render`
    draws again. The first picture is there as early as possible.
    """
    make(scene, **options)


def make(
    scene: str,
    *,
    output: Path | None,
    assignments: tuple[tuple[str, Any], ...],
    seed: int | None,
    precision: str | None,
    frames: tuple[int, int | None],
    size: list[int] | None,
    form: str,
    threads: int | None,
    no_film: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Load a scene, change its values, make the film and print the paths."""
    import motes

    name = Path(scene).stem
    folder = output if output is not None else Path(name)
    if folder.suffix.lower() in (".mp4", ".webp", ".gif", ".png"):
        raise click.UsageError(
            f"-o names a folder, not a file. Write -o {folder.with_suffix('')} "
            f"and, for another kind of film, --format webp."
        )
    if threads is not None:
        motes.threads(threads)
    values = dict(assignments)
    given = {"seed": seed, "precision": precision, "film.size": size}
    values.update({key: value for key, value in given.items() if value is not None})
    document = motes.load(scene).with_values(values)
    first, last = frames
    try:
        with shown(name, quiet=quiet, verbose=verbose) as watch:
            made = motes.film(
                document, folder, name=name, first=first, last=last,
                draw=not no_film, form=form, watch=watch,
            )  # fmt: skip
    except (KeyboardInterrupt, motes.SimulationError):
        _tell_kept(folder)
        raise
    if verbose:
        from motes.production import open_frames

        size_kept = open_frames(folder).size()
        click.echo(f"{rounded(size_kept)}B of frames", err=True)
    if made.captures and not quiet:
        click.echo(f"{made.captures} caught; `motes info {folder}` tells when", err=True)
    for path in made.paths():
        click.echo(path)


def _tell_kept(folder: Path) -> None:
    """Say what a run that ended early has left, and how to go on."""
    from motes.errors import OutputError
    from motes.production import open_frames

    try:
        kept = len(open_frames(folder).numbers())
    except OutputError:
        kept = 0
    if kept:
        click.echo(
            f"Finished frames kept: {kept}. `motes render {folder}` makes a film of them.", err=True
        )
