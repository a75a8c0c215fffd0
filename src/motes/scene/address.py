"""Addresses: one text for each value of a scene, the same in Python and on the command line.

The full address of a value is `seed`, `film.size`, `gravity.g` for a component of the whole scene,
`water.life` for a system, `water.cone.rate` for a component of a system. A component may also be
called by its list, `water.emit.rate`, and any word but the last may be left out while one value
only answers: `emit.rate`, or just `rate`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

from motes.catalog import Component
from motes.errors import Problem, SceneError, likely

if TYPE_CHECKING:
    from motes.scene.document import Scene, System

_OWNER = re.compile(r'[a-z ]+( "[^"]*")?: ')
"""How a line about a component or a table begins."""

MOST_SHOWN = 6
"""Candidates that an error about an address names."""


def component_address(system: System | None, component: Component) -> str:
    """Full address of a component, on which its random numbers hang: `water.cone` or `gravity`."""
    return component.name if system is None else f"{system.name}.{component.name}"


@dataclass(frozen=True)
class Place:
    """One value of a scene: its address, and where it stands in the plain document."""

    address: str
    words: tuple[str, ...]
    """The address with the list that the component is in: water, emit, cone, rate."""
    path: tuple[str | int, ...]

    def spellings(self) -> tuple[str, ...]:
        """The address with the component's own name, with its list's, and with both."""
        by_list = (*self.words[:-2], self.words[-1])
        return self.address, ".".join(by_list), ".".join(self.words)

    def answers(self, words: list[str]) -> bool:
        """Whether `words` are the place's own in order, with some but the last left out."""
        own = iter(self.words)
        return words[-1] == self.words[-1] and all(word in own for word in words)


def places(scene: Scene) -> Iterator[Place]:
    """All values of a scene."""
    for name in scene.parameters:
        yield Place(name, (name,), (name,))
    for table in ("film", "camera", "sky", "periodic"):
        for name in getattr(scene, table).parameters:
            yield Place(f"{table}.{name}", (table, name), (table, name))
    for kind in scene.lists:
        for i, part in enumerate(getattr(scene, kind)):
            yield from _of_component(None, part, kind, (kind, i))
    for i, system in enumerate(scene.systems):
        for name in system.parameters:
            yield Place(f"{system.name}.{name}", (system.name, name), ("system", i, name))
        yield from _of_component(system, system.look, "look", ("system", i, "look"))
        for kind in system.lists:
            for j, part in enumerate(getattr(system, kind)):
                yield from _of_component(system, part, kind, ("system", i, kind, j))


def _of_component(
    system: System | None, part: Component, kind: str, path: tuple[str | int, ...]
) -> Iterator[Place]:
    owner = (system.name,) if system else ()
    for name in part.parameters:
        words = (*owner, kind, part.name, name)
        yield Place(f"{component_address(system, part)}.{name}", words, (*path, name))


def placed(
    scene: Scene, values: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[tuple[str | int, ...], str]]:
    """The scene's plain document with other values at addresses, and the addresses by path.

    Raises SceneError, a line for each address that is unknown or stands for several values.
    """
    menu = list(places(scene))
    document = scene.document()
    problems, given = [], {}
    for address, value in values.items():
        found = _found(menu, address)
        if len(found) == 1:
            _put(document, found[0].path, value)
            given[found[0].path] = address
        else:
            problems.append(Problem((), _unclear(address, found, menu)))
    if problems:
        raise SceneError(problems, source="")
    return document, given


def addressed(problem: Problem, given: Mapping[tuple[str | int, ...], str]) -> Problem:
    """A problem, named by the address under which its value was given."""
    for path, address in given.items():
        if problem.path[: len(path)] == path and not problem.message.startswith(f"{address} "):
            fault = _OWNER.sub("", problem.message)
            return replace(problem, message=f"{address}: {fault}")
    return problem


def _found(menu: list[Place], address: str) -> list[Place]:
    exact = [place for place in menu if address in (place.address, ".".join(place.words))]
    return exact or [place for place in menu if place.answers(address.split("."))]


def _unclear(address: str, found: list[Place], menu: list[Place]) -> str:
    if found:
        shown = ", ".join(place.address for place in found[:MOST_SHOWN])
        more = f" and {len(found) - MOST_SHOWN} more" if len(found) > MOST_SHOWN else ""
        return f'"{address}" stands for several values: {shown}{more}. Write one of them.'
    last = address.split(".")[-1]
    ends = [place.address for place in menu if place.words[-1] == last]
    spelt = list(chain(*(place.spellings() for place in menu)))
    hint = likely(address, [one for one in spelt if one.split(".")[-1] == last]) or likely(
        address, spelt
    )
    shown = f" It could be: {', '.join(ends[:MOST_SHOWN])}." if ends and not hint else ""
    return f'no value has the address "{address}".{hint}{shown or _choice(address, menu)}'


def _choice(address: str, menu: list[Place]) -> str:
    """What there is where an address leaves those of the scene: ` sparks.emit has rate, ...`."""
    words = address.split(".")
    for length in range(len(words), 0, -1):
        inside = [place for place in menu if list(place.words[:length]) == words[:length]]
        if inside:
            names = [place.words[min(length, len(place.words) - 1)] for place in inside]
            if len(set(names)) == 1:
                names = [place.words[-1] for place in inside]
            return f" {'.'.join(words[:length])} has {', '.join(dict.fromkeys(names))}."
    return f" There are: {', '.join(dict.fromkeys(place.words[0] for place in menu))}."


def _put(document: dict[str, Any], path: tuple[str | int, ...], value: Any) -> None:
    """Set one value; tables that only held defaults are made."""
    table: Any = document
    for key in path[:-1]:
        if isinstance(key, int):
            table = table[key]
        elif key == "look":
            table = table.setdefault(key, {"type": "points"})
        else:
            table = table.setdefault(key, {})
    table[path[-1]] = value
