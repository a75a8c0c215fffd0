"""Options that several commands share, and the values that they take."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from typing import Any, TypeVar

import click

Function = TypeVar("Function", bound=Callable[..., Any])


class FrameRange(click.ParamType):
    """`1-48`, `12`, `10-` or `-48`: numbers of the first and last frame, from 1."""

    name = "frames"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int | None]:
        """First and last frame; the last is None where the range is open."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{0,9})(-?)(\d{0,9})", value, re.ASCII)
        if match is None or not (match[1] or match[3]):
            self.fail(f'"{value}" is not a range of frames such as 1-48, 12 or 10-.', param, ctx)
        first = int(match[1] or 1)
        last = int(match[3]) if match[3] else None if match[2] else first
        if first < 1 or (last is not None and last < first):
            self.fail(f'"{value}": frames count from 1 and the last is not before the first.')
        return first, last


class PictureSize(click.ParamType):
    """`1920x1080`: width and height in pixels."""

    name = "WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> list[int]:
        """Width and height."""
        if isinstance(value, list):
            return value
        match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", value.lower(), re.ASCII)
        if match is None:
            self.fail(f'"{value}" is not a size such as 1920x1080.', param, ctx)
        return [int(match[1]), int(match[2])]


class Assignment(click.ParamType):
    """`water.emit.rate=2000`: an address in the scene and a value as TOML writes it.

    A word needs no quotes: `integrator=leapfrog`.
    """

    name = "ADDRESS=VALUE"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, Any]:
        """Address and value."""
        if isinstance(value, tuple):
            return value
        address, sign, text = value.partition("=")
        if not sign or not address.strip():
            self.fail(f'"{value}" is not ADDRESS=VALUE, such as water.emit.rate=2000.', param, ctx)
        return address.strip(), self._read(text.strip(), param, ctx)

    def _read(self, text: str, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if re.fullmatch(r"#[0-9a-fA-F]{6,8}|[A-Za-z_][\w./ -]*", text) and text not in _WORDS:
            return text
        try:
            table = tomllib.loads(f"value = {text}")
        except (tomllib.TOMLDecodeError, RecursionError):
            table = {}
        if set(table) != {"value"}:
            fix = "Write it as in a scene file: 2000, [1, 2, 3], { mean = 2, spread = 1 }."
            self.fail(f"{text!r} is not a value. {fix}", param, ctx)
        return table["value"]


_WORDS = ("true", "false", "inf", "nan")
"""Words that mean something in TOML without quotes."""


def scene_options(function: Function) -> Function:
    """--set, --seed, --precision: values that replace those of the scene."""
    precision = click.Choice(["single", "double"])
    for option in (
        click.option("--precision", type=precision, help="Numbers of 32 or 64 bits."),
        click.option(
            "--seed", type=click.IntRange(0, 2**64 - 1), metavar="N", help="Another random outcome."
        ),
        set_option,
    ):
        function = option(function)
    return function


def set_option(function: Function) -> Function:
    """--set ADDRESS=VALUE, as often as one likes."""
    return click.option(
        "--set", "assignments", type=Assignment(), multiple=True,
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
        click.option("--size", type=PictureSize(), metavar="WxH", help="Pixels of the film."),
        click.option(
            "--frames", type=FrameRange(), metavar="1-48", default="1-",
            help="Only these; also 12 or 10-.",
        ),
    ):  # fmt: skip
        function = option(function)
    return function


def json_option(function: Function) -> Function:
    """--json: the same as data for programs."""
    return click.option("--json", "as_json", is_flag=True, help="Print JSON.")(function)


def scene_argument(function: Function) -> Function:
    """SCENE: a name of the gallery or a path."""
    return click.argument("scene", metavar="SCENE", shell_complete=complete_scene)(function)


def complete_scene(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Names of the gallery, and files where none begins so."""
    from click.shell_completion import CompletionItem

    from motes import gallery

    names = [CompletionItem(name) for name in gallery() if name.startswith(incomplete)]
    return names or [CompletionItem(incomplete, type="file")]
