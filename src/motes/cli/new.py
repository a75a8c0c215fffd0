"""`motes new`: a copy of a scene to change."""

from __future__ import annotations

from pathlib import Path

import click

from motes.cli.options import complete_scene


@click.command(short_help="Copy a scene of the gallery, to change it.")
@click.argument("name", shell_complete=complete_scene)
@click.argument("path", type=click.Path(path_type=Path), required=False)
@click.option("--force", is_flag=True, help="Overwrite a file that is there.")
def command(name: str, path: Path | None, force: bool) -> None:
    """Copy the scene NAME of the gallery to PATH, with a comment on each choice."""
    from motes.files import written_whole
    from motes.scene import gallery_text

    text = gallery_text(name)
    target = path if path is not None else Path(f"{name}.toml")
    if target.is_dir():
        target = target / f"{name}.toml"
    if target.suffix.lower() != ".toml":
        toml = target.with_suffix(".toml")
        raise click.UsageError(f"{target}: a scene is saved as .toml. Write {toml}")
    if target.exists() and not force:
        raise click.UsageError(f"{target} is there already. Add --force to overwrite it.")
    with written_whole(target) as file:
        file.write(text.encode())
    click.echo(target)
    click.echo(f"Change it, then: motes run {target}", err=True)
