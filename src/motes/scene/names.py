"""Names: what one may be, and that each stands for one thing.

Everything in a scene has an address made of names, on which its random numbers hang. So a name is
a word, and no two components of one system, and no two things of the scene, have the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from motes.errors import Problem, likely

WORD = re.compile(r"[^\W\d][\w-]{0,63}")
"""A letter or underscore, then letters, digits, underscores and hyphens."""

NAMING = ("systems", "sources", "targets", "hunters")
"""Parameters of interactions that name systems."""

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class Named:
    """One entry of a list, whose name is its type unless said."""

    path: Path
    name: str
    said: bool

    @property
    def at(self) -> Path:
        """Where to point for a fault of the name."""
        return (*self.path, "name") if self.said else self.path


def entries(values: Mapping[str, Any], lists: Iterable[str]) -> Iterator[Named]:
    """The entries of lists that need not be valid, as far as they have a name."""
    for key in lists:
        items = values.get(key)
        for i, item in enumerate(items if isinstance(items, list | tuple) else ()):
            own, type = _key(item, "name"), _key(item, "type")
            name = type if own is None else own
            if isinstance(name, str):
                yield Named((key, i), name, own is not None and own != type)


def _key(item: Any, key: str) -> Any:
    return item.get(key) if isinstance(item, Mapping) else getattr(item, key, None)


def faults(
    values: Mapping[str, Any], lists: Iterable[str], reserved: Iterable[str], where: str
) -> list[Problem]:
    """Names in lists that are taken twice or reserved.

    `where` says whose lists they are: `system "water": ` or nothing for the scene itself.
    """
    seen: dict[str, Named] = {}
    taken = set(reserved)
    found = []
    for entry in entries(values, lists):
        name = entry.name
        if name in taken:
            message = f'the name "{name}" has a meaning of its own; take another.'
            found.append(Problem(entry.at, f"{where}{message}"))
        elif name in seen:
            message = _twice(name, str(seen[name].path[0]), str(entry.path[0]))
            found.append(Problem(entry.at, f"{where}{message}"))
        seen.setdefault(name, entry)
    return found


def _twice(name: str, first: str, second: str) -> str:
    where = f"two in {first}" if first == second else f"one in {first} and one in {second}"
    return f'{where} have the name "{name}"; give one of them a name of its own.'


def strangers(values: Mapping[str, Any]) -> list[Problem]:
    """Systems that interactions name and that there are not, in values that need not be valid."""
    known = [system.name for system in entries(values, ["system"])]
    if not known or len(known) < len(values["system"]):
        return []  # One without a name might be meant.
    found = []
    for entry in entries(values, ["interact"]):
        part = values["interact"][entry.path[1]]
        for key in NAMING:
            given = _key(part, key)
            given = getattr(given, "value", given)  # A control in a component, else plain.
            for i, name in enumerate(given if isinstance(given, list | tuple) else ()):
                if isinstance(name, str) and name not in known:
                    message = (
                        f'interaction "{entry.name[:64]}": no system "{name[:64]}".'
                        f"{likely(name, known)} There are: {', '.join(known)}."
                    )
                    found.append(Problem((*entry.path, key, i), message))
    return found


def word(name: Any, path: Path, where: str) -> list[Problem]:
    """The fault of a name that is no word, if it is there at all."""
    if name is None or (isinstance(name, str) and WORD.fullmatch(name)):
        return []
    shown = f'"{name[:40]}"' if isinstance(name, str) else str(name)[:40]
    rule = "a name must be a word of letters, digits, _ and -"
    return [Problem(path, f"{where}{rule}, not {shown}.")]
