"""`motes check`: is a scene valid?"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from motes.cli.options import complete_scene, components_option, json_option

if TYPE_CHECKING:
    import motes
    from motes.errors import Problem


@click.command(short_help="Find all mistakes in scenes.")
@click.argument(
    "scenes", metavar="SCENE...", nargs=-1, required=True, shell_complete=complete_scene
)
@components_option
@json_option
@click.option("-q", "--quiet", is_flag=True, help="Print mistakes only.")
@click.pass_context
def command(ctx: click.Context, scenes: tuple[str, ...], as_json: bool, quiet: bool) -> None:
    """Find all mistakes in scenes, a line each; nothing is simulated.

    Ends with exit code 2 if there are any.
    """
    import motes

    report: list[dict[str, Any]] = []
    for name in scenes:
        problems: tuple[Problem, ...] = ()
        try:
            scene = motes.load(name)
        except motes.SceneError as error:
            problems = error.problems
            if not as_json:
                click.echo("\n".join(error.lines()), err=True)
        else:
            if not (quiet or as_json):
                click.echo(f"{name}: good. {_content(scene)}")
        report.append({"scene": name, "problems": [asdict(problem) for problem in problems]})
    if as_json:
        click.echo(json.dumps(report, indent=2))
    if any(entry["problems"] for entry in report):
        ctx.exit(2)


def _content(scene: motes.Scene) -> str:
    systems = ", ".join(system.name for system in scene.systems) or "none"
    return f"Systems: {systems}; {scene.duration:g} s at {scene.film.fps:g} frames a second."
