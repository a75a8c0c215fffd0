"""`motes demo`: the first thing to try."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motes.cli.options import film_options
from motes.cli.run import make

SCENE = "sprinkler"


@click.command(short_help="Make a first film, of a sprinkler.")
@film_options
def command(**options: Any) -> None:
    """Simulate and draw the scene "sprinkler" into the folder ./sprinkler."""
    make(
        SCENE,
        output=Path(SCENE),
        assignments=(),
        seed=None,
        precision=None,
        no_film=False,
        **options,
    )
    if not options["quiet"]:
        click.echo(f"Now make it yours: motes new {SCENE} my.toml", err=True)
