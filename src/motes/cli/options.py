"""Options that several commands share, and the values that they take."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Function = TypeVar("Function", bound=Callable[..., Any])


def frame_range(text: str) -> tuple[int, int | None]:
    """First and last frame of `1-48`, `12`, `10-` or `-48`, from 1; None: to the end."""
    match = re.fullmatch(r"(\d{0,9})(-?)(\d{0,9})", text, re.ASCII)
    if match is None or not (match[1] or match[3]):
        raise click.BadParameter(f'"{text}" is not a range of frames such as 1-48, 12 or 10-.')
    first = int(match[1] or 1)
    last = int(match[3]) if match[3] else None if match[2] else first
    if first < 1 or (last is not None and last < first):
        raise click.BadParameter(
            f'"{text}": frames count from 1, the last is not before the first.'
        )
    return first, last


def picture_size(text: str) -> list[int]:
    """Width and height of `1920x1080`."""
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text.lower(), re.ASCII)
    if match is None:
        raise click.BadParameter(f'"{text}" is not a size such as 1920x1080.')
    return [int(match[1]), int(match[2])]


def assignment(text: str) -> tuple[str, Any]:
    """Address and value of `water.emit.rate=2000`; the value is written as in TOML.

    A word or a colour needs no quotes: `integrator=leapfrog`, `water.color=#4fa3ff`.
    """
    address, sign, value = (part.strip() for part in text.partition("="))
    if not sign or not address:
        raise click.BadParameter(f'"{text}" is not ADDRESS=VALUE, such as water.emit.rate=2000.')
    if re.fullmatch(r"#[0-9a-fA-F]{6,8}|[A-Za-z_][\w./ -]*", value) and value not in _WORDS:
        return address, value
    try:
        table = tomllib.loads(f"value = {value}")
    except (tomllib.TOMLDecodeError, RecursionError):
        table = {}
    if set(table) != {"value"}:
        fix = "Write it as in a scene file: 2000, [1, 2, 3], { mean = 2, spread = 1 }."
        raise click.BadParameter(f"{value!r} is not a value. {fix}")
    return address, table["value"]


_WORDS = ("true", "false", "inf", "nan")
"""Words that mean something in TOML without quotes."""


def scene_options(function: Function) -> Function:
    """--set, --seed, --precision: values that replace those of the scene."""
    precision = click.Choice(["single", "double"])
    for option in (
        click.option("--precision", type=precision, help="Numbers of 32 or 64 bits."),
        click.option("--seed", type=int, metavar="N", help="Another random outcome."),
        set_option,
    ):
        function = option(function)
    return function


def set_option(function: Function) -> Function:
    """--set ADDRESS=VALUE, as often as one likes."""
    return click.option(
        "--set", "assignments", type=assignment, multiple=True, metavar="ADDRESS=VALUE",
        help="Change a value of the scene: --set water.emit.rate=2000. May be repeated.",
    )(function)  # fmt: skip


def film_options(function: Function) -> Function:
    """--frames, --size, --format, --threads, -q, -v: how a film is made."""
    for option in (
        click.option("-v", "--verbose", is_flag=True, help="Say more."),
        click.option("-q", "--quiet", is_flag=True, help="Say nothing but errors and paths."),
        click.option(
            "--threads", type=click.IntRange(0), metavar="N", help="Processors to use; 0: all."
        ),
        click.option(
            "--format", "form", type=click.Choice(["mp4", "webp", "gif"]), default="mp4",
            show_default=True, help="Kind of film.",
        ),
        click.option("--size", type=picture_size, metavar="WxH", help="Pixels of the film."),
        click.option(
            "--frames", type=frame_range, metavar="1-48", default="1-",
            help="Only these; also 12 or 10-.",
        ),
    ):  # fmt: skip
        function = option(function)
    return function


def components_option(function: Function) -> Function:
    """--components FILE: a Python file that declares components, which is run."""

    def include_all(_: click.Context, __: click.Parameter, paths: tuple[Path, ...]) -> None:
        from motes.catalog.scripts import include

        for path in paths:
            include(path)

    return click.option(
        "--components", type=click.Path(path_type=Path), multiple=True, metavar="FILE",
        callback=include_all, expose_value=False,
        help="Run a Python file whose components the scene uses. May be repeated.",
    )(function)  # fmt: skip


def json_option(function: Function) -> Function:
    """--json: the same as data for programs."""
    return click.option("--json", "as_json", is_flag=True, help="Print JSON.")(function)


def scene_argument(function: Function) -> Function:
    """SCENE: a name of the gallery or a path."""
    return click.argument("scene", metavar="SCENE", shell_complete=complete_scene)(function)


def complete_scene(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Names of the gallery, and files where none begins so."""
    from click.shell_completion import CompletionItem

    from motes.scene import gallery

    names = [CompletionItem(name) for name in gallery() if name.startswith(incomplete)]
    return names or [CompletionItem(incomplete, type="file")]
