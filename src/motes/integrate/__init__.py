"""Time-stepping methods: each file is a table, `method`, and says in its text when to use it."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TypeGuard

from motes.errors import SceneError, likely
from motes.tableau import Implicit, Method, Table


@cache
def names() -> tuple[str, ...]:
    """Names of all methods, in alphabetical order."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if m.name[0] != "_"))


def methods() -> dict[str, Table]:
    """All methods by name, in alphabetical order."""
    return {name: table(name) for name in names()}


def scene_methods() -> dict[str, Method]:
    """The methods that a scene can use, by name, in alphabetical order."""
    return {name: found for name, found in methods().items() if _scenic(found)}


def _scenic(found: Table) -> TypeGuard[Method]:
    """Whether a scene can use it: a step without a past, its stages solved one by one."""
    return isinstance(found, Method) and (not isinstance(found, Implicit) or found.diagonal)


@cache
def table(name: str) -> Table:
    """A method by name. Raises SceneError with the menu."""
    if name not in names():
        menu = ", ".join(scene_methods())
        raise SceneError(
            f'no integrator "{name}".{likely(name, names())} Scenes take {menu}; motes.ode takes '
            f"{', '.join(other for other in names() if other not in scene_methods())} as well."
        )
    found: Table = importlib.import_module(f"{__name__}.{name}").method
    return found


def method(name: str) -> Method:
    """A method that a scene can use. Raises SceneError with the menu."""
    found = table(name)
    if not _scenic(found):
        menu = ", ".join(scene_methods())
        raise SceneError(
            f'integrator "{name}" works in motes.ode, but not in a scene. Scenes take {menu}.'
        )
    return found
