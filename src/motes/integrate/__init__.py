"""Time-stepping methods: each file is a table, `method`, and says in its text when to use it."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TypeGuard

from motes.errors import SceneError, likely
from motes.tableau import BackwardDifference, Implicit, Method, Nystrom, Rosenbrock, Table


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


def _unscenic(found: Table) -> str:
    """Why a scene cannot use a method; empty if it can."""
    if isinstance(found, BackwardDifference):
        return "it remembers the step before, and particles are born and bounce within steps"
    if isinstance(found, Nystrom):
        return "it is for forces without drag or wind, which scenes cannot promise"
    if isinstance(found, Rosenbrock):
        return "its matrix would need every force's derivatives to the last digit"
    if isinstance(found, Implicit) and not found.diagonal:
        return "its stages are solved together, those of scenes one by one"
    return ""


def _scenic(found: Table) -> TypeGuard[Method]:
    """Whether a scene can use it: a step without a past, its stages solved one by one."""
    return isinstance(found, Method) and not _unscenic(found)


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
            f'integrator "{name}" works in motes.ode, but not in a scene: {_unscenic(found)}. '
            f"Scenes take {menu}; of these, sdirk2, kencarp3 and kencarp4 are for stiff forces."
        )
    return found
