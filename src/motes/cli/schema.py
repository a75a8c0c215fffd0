"""`motes schema`: the form of a scene, for editors."""

from __future__ import annotations

import json

import click


@click.command(short_help="Print the JSON Schema of scenes.")
def command() -> None:
    """Print the JSON Schema of scenes, which lets an editor complete and check them.

    \b
    motes schema > scene.schema.json
    Then begin a scene with the line: #:schema scene.schema.json
    """
    from motes.scene.schema import schema

    click.echo(json.dumps(schema(), indent=2, ensure_ascii=False))
