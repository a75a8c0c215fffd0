"""Reading scenes: a name of the gallery or a file, TOML or JSON, to a checked Scene."""

from __future__ import annotations

import json
import os
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from motes.errors import Problem, SceneError
from motes.files import fault
from motes.scene.document import Scene, from_document
from motes.scene.gallery import gallery_text, unknown
from motes.scene.limits import SIZE, excess, overgrown
from motes.scene.lines import json_lines, line_of, toml_lines

Format = Literal["toml", "json"]

_AT = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")

_HALF = re.compile(
    r"\\u[dD][89abAB][0-9a-fA-F]{2}(?!\\u[dD][c-fC-F])|(?<!\\u[dD][89abAB]..)\\u[dD][c-fC-F]"
)
"""An escape of half a surrogate pair without the other half."""

_CLEARER = {
    "Invalid value": 'a value must be a number, true, false, a "text" in quotes, [a, list] or '
    "{ a = table }",
    "Cannot overwrite a value": "this key is here a second time",
}
"""Words of tomllib that say little to somebody who writes scenes."""


def load(scene: str | os.PathLike[str]) -> Scene:
    """The scene of a name of the gallery, or of a path to a .toml or .json file.

    Raises:
        SceneError: there is no such scene, or it is not valid; holds every problem with its line.
        OutputError: the file cannot be read.
    """
    name, path = os.fspath(scene), Path(scene)
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".json"):
        return loads(gallery_text(name), source=f"{name}.toml")
    if not path.is_file():
        raise unknown(name, "no file")
    try:
        with path.open("rb") as file:
            content = file.read(SIZE + 1)
    except OSError as error:
        raise fault("read", path, error) from error
    return loads(content, source=name, format="json" if suffix == ".json" else "toml")


def loads(content: str | bytes, source: str = "scene", format: Format = "toml") -> Scene:
    """The scene that a text describes; `source` is how errors name it.

    Raises SceneError with every problem and its line.
    """
    text = _text(content, source)
    if found := excess(text):
        raise SceneError([found], source)
    document = _toml(text, source) if format == "toml" else _json(text, source)
    if found := overgrown(document):
        raise SceneError(_with_lines([found], text, format), source)
    try:
        return from_document(document, source)
    except SceneError as error:
        raise SceneError(_with_lines(error.problems, text, format), source) from None


def _text(content: str | bytes, source: str) -> str:
    """The text of a file, without a byte order mark."""
    try:
        data = content.encode() if isinstance(content, str) else content
        text = data.decode("utf-8-sig")
    except UnicodeError as error:
        before = content[: error.start] if isinstance(error, UnicodeDecodeError) else b""
        line = before.count(b"\n") + 1 if isinstance(before, bytes) else None
        message = "this is not UTF-8 text; save the file as UTF-8."
        raise SceneError([Problem((), message, line)], source) from None
    if len(data) > SIZE:
        message = f"it is larger than {SIZE / 1e6:g} MB, the most that a scene may be."
        raise SceneError([Problem((), message)], source)
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise SceneError([Problem((), "a NUL character; this is not a text file.", line)], source)
    return text


def _toml(text: str, source: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except ValueError as error:
        words, line, column = str(error), text.count("\n") + 1, ""
        if at := _AT.search(words):
            words = words[: at.start()]
            if at[1]:
                line, column = int(at[1]), f" (column {at[2]})"
        words = _CLEARER.get(words, words[:1].lower() + words[1:])
        raise SceneError([Problem((), f"not TOML: {words}{column}.", line)], source) from None


def _json(text: str, source: str) -> dict[str, Any]:
    twice = False

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        nonlocal twice
        made = dict(pairs)
        twice = twice or len(made) != len(pairs)
        return made

    try:
        document = json.loads(text, object_pairs_hook=unique)
    except json.JSONDecodeError as error:
        words = f"{error.msg[:1].lower()}{error.msg[1:]} (column {error.colno})"
        raise SceneError([Problem((), f"not JSON: {words}.", error.lineno)], source) from None
    if twice:
        lines, again = json_lines(text)
        found = [Problem(p, f'the key "{p[-1]}" is here a second time.', lines[p]) for p in again]
        raise SceneError(found, source)
    if "\\u" in text:
        try:
            json.dumps(document, ensure_ascii=False).encode()
        except UnicodeError:
            message = "half of a surrogate pair, \\ud800 to \\udfff, is no character."
            half = _HALF.search(text)
            line = text.count("\n", 0, half.start()) + 1 if half else None
            raise SceneError([Problem((), message, line)], source) from None
    if not isinstance(document, dict):
        message = 'a scene must be an object { "title": ..., "system": [...] }.'
        raise SceneError([Problem((), message, 1)], source)
    return document


def _with_lines(problems: Any, text: str, format: Format) -> list[Problem]:
    lines = toml_lines(text) if format == "toml" else json_lines(text)[0]
    return [p if p.line else replace(p, line=line_of(lines, p.path)) for p in problems]
