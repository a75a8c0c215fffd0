"""Limits that are checked before and after a parser, so that no file makes it hang or overflow."""

from __future__ import annotations

import re
from typing import Any

from motes.errors import Problem
from motes.scene.lines import STRING

SIZE = 1_000_000
"""Bytes of a scene file."""

DEPTH = 64
"""Tables and lists within each other, and names in a dotted key."""

DIGITS = 400
"""Digits of a number; Python takes a time that grows with their square."""

KEYS = 10_000
"""Keys of a scene, all tables together."""

_PART = re.compile(
    rf"(?P<text>{STRING})|(?P<comment>\#[^\n]*)|(?P<mark>[\[\]{{}}])"
    r"|(?P<run>[^\[\]{}\#\"']+)|(?P<other>.)",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(rf"[0-9_]{{{DIGITS}}}")
_BREAK = re.compile(r"[\n=,:]")


def excess(text: str) -> Problem | None:
    """What of a text is beyond the limits, before it is parsed."""
    depth = dots = 0
    for match in _PART.finditer(text):
        kind, part = match.lastgroup, match[0]
        if kind == "mark":
            depth += 1 if part in "[{" else -1
        elif kind == "run":
            if _LONG_NUMBER.search(part):
                return _beyond(text, match.start(), f"a number has more than {DIGITS} digits")
            pieces = _BREAK.split(part)
            longest = max(dots + pieces[0].count("."), *(p.count(".") for p in pieces[1:]), 0)
            dots = pieces[-1].count(".") + (dots if len(pieces) == 1 else 0)
            if longest >= DEPTH:
                return _beyond(text, match.start(), f"a key has more than {DEPTH} names")
        if depth > DEPTH:
            message = f"more than {DEPTH} tables and lists are within each other"
            return _beyond(text, match.start(), message)
    return None


def _beyond(text: str, at: int, message: str) -> Problem:
    return Problem((), f"{message}.", text.count("\n", 0, at) + 1)


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
            rest += [((*path, key), inner) for key, inner in value.items()]
        elif isinstance(value, list):
            inner = ((i, v) for i, v in enumerate(value) if isinstance(v, dict | list))
            rest += [((*path, i), v) for i, v in inner]
    if keys > KEYS:
        return Problem((), f"it has {keys} keys and tables; at most {KEYS} are allowed.")
    return None
