"""`motes ode`: a problem, what methods make of it, and which is worth its evaluations."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from motes.errors import likely

if TYPE_CHECKING:
    from motes.ode import MethodFacts


def _words(ctx: click.Context, parameter: click.Parameter, text: str | None) -> tuple[str, ...]:
    words = tuple(word.strip() for word in (text or "").split(",") if word.strip())
    if words:
        from motes.integrate import names

        for word in words:
            if word not in names():
                menu = ", ".join(names())
                raise click.BadParameter(
                    f'no method "{word}".{likely(word, names())} There are: {menu}.'
                )
    return words


def _lengths(ctx: click.Context, parameter: click.Parameter, text: str | None) -> tuple[float, ...]:
    try:
        lengths = tuple(float(word) for word in (text or "").split(",") if word.strip())
    except ValueError:
        raise click.BadParameter(f'"{text}" is not a list of steps such as 0.1,0.05.') from None
    if not all(0 < length < float("inf") for length in lengths):
        raise click.BadParameter("steps must be above 0.")
    return lengths


@click.command(short_help="Draw an ODE problem and what methods make of it.")
@click.argument("name", metavar="[PROBLEM]", required=False)
@click.option("--method", "methods", callback=_words, metavar="A,B", help="Methods to compare.")
@click.option(
    "--step", "steps", callback=_lengths, metavar="H,H",
    help="Steps: the path is drawn at the first; one alone is halved to measure orders.",
)  # fmt: skip
@click.option(
    "--save", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
    help="Where the picture goes: .png, .svg or .pdf. Without it, PROBLEM.png.",
)  # fmt: skip
def command(
    name: str | None, methods: tuple[str, ...], steps: tuple[float, ...], save: Path | None
) -> None:
    """Draw PROBLEM: paths, order, energy, stability, work. Without it, list problems and methods.

    \b
    motes ode circle
    motes ode kepler --method leapfrog,rk4 --step 0.05 --save kepler.svg
    """
    from motes.problem import problem

    if name is None:
        _list()
        return
    problem(name)
    target = save if save is not None else Path(f"{name}.png")
    if target.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise click.UsageError(f"{target}: a picture is saved as .png, .svg or .pdf.")
    from motes.files import written_whole
    from motes.ode.picture import draw

    try:
        figure = draw(name, methods=methods or None, steps=steps or None)
    except ValueError as error:
        raise click.UsageError(str(error)) from None
    with written_whole(target) as file:
        figure.savefig(file, format=target.suffix[1:].lower(), dpi=110)
    click.echo(target)


def _list() -> None:
    from motes import ode
    from motes.problem import about, names

    text = click.HelpFormatter(max_width=100)
    with text.section("Problems"):
        text.write_dl([(name, about(name)) for name in names()])
    with text.section("Methods"):
        text.write_dl([(m.name, _facts(m)) for m in ode.methods()])
    click.echo(text.getvalue().rstrip())


def _facts(m: MethodFacts) -> str:
    """One method in a line."""
    facts = [f"order {m.order}", f"{m.stages} stage{'s' if m.stages > 1 else ''}"]
    facts += ["implicit"] * m.implicit + ["symplectic"] * m.symplectic
    if m.embedded is not None:
        facts.append(f"estimate of order {m.embedded}")
    if not math.isnan(m.real):
        facts.append(f"decay to h k = {m.real:.3g}")
    return ", ".join([*facts, f"oscillation to h w = {m.imaginary:.3g}"])
