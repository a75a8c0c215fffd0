"""Limits that are checked before and after a parser, so that no file makes it hang or overflow."""

from __future__ import annotations

import re
from typing import Any

from motes.errors import Problem
from motes.scene.lines import STRING

SIZE = 500_000
"""Bytes of a scene file."""

DEPTH = 64
"""Tables and lists within each other, and names in a dotted key."""

DIGITS = 400
"""Digits of a number; Python takes a time that grows with their square."""

MARKS = 40_000
"""Brackets, commas, dots and equals signs: what makes a parser work."""

KEYS = 5_000
"""Keys of a scene, all tables together."""

_PART = re.compile(
    rf"(?P<text>{STRING})|(?P<comment>\#[^\n]*)|(?P<mark>[\[\]{{}}])"
    r"|(?P<run>[^\[\]{}\#\"']+)|(?P<other>.)",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(rf"(?<![0-9a-fA-F_xob])[0-9][0-9a-fA-F_xob]{{{DIGITS}}}")
_BREAK = re.compile(r"[\n=,:]")
_MARK = re.compile(r"[=,:.]")


def excess(text: str) -> Problem | None:
    """What of a text is beyond the limits, before it is parsed."""
    depth = dots = marks = 0
    for match in _PART.finditer(text):
        kind, part = match.lastgroup, match[0]
        fault = ""
        if kind == "mark":
            marks += 1
            depth += 1 if part in "[{" else -1
            if depth > DEPTH:
                fault = f"more than {DEPTH} tables and lists are within each other"
        elif kind == "run":
            marks += len(_MARK.findall(part))
            if _LONG_NUMBER.search(part):
                fault = f"a number has more than {DIGITS} digits"
            pieces = _BREAK.split(part) if marks <= MARKS else [""]
            counts = [piece.count(".") for piece in pieces]
            counts[0] += dots
            dots = counts[-1]
            if max(counts) >= DEPTH:
                fault = f"a key has more than {DEPTH} names"
        if marks > MARKS:
            fault = "it holds more values than a scene may have"
        if fault:
            return Problem((), f"{fault}.", text.count("\n", 0, match.start()) + 1)
    return None


def overgrown(document: dict[str, Any]) -> Problem | None:
    """What of a parsed document is beyond the limits."""
    keys = 0
    rest: list[tuple[tuple[str | int, ...], Any]] = [((), document)]
    while rest:
        path, value = rest.pop()
        if len(path) > DEPTH:
            return Problem(path, f"more than {DEPTH} tables and lists are within each other.")
        if isinstance(value, dict):
            keys += len(value) + 1
            if keys > KEYS:
                return Problem((), f"it has more than {KEYS} keys and tables.")
            rest += [((*path, key), inner) for key, inner in value.items()]
        elif isinstance(value, list):
            inner = ((i, v) for i, v in enumerate(value) if isinstance(v, dict | list))
            rest += [((*path, i), v) for i, v in inner]
    return None
