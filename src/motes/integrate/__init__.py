"""Time-stepping methods: each file is a table, `method`, and says in its text when to use it."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from motes.errors import SceneError, likely
from motes.tableau import Table


@cache
def names() -> tuple[str, ...]:
    """Names of all methods, in alphabetical order."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if m.name[0] != "_"))


def methods() -> dict[str, Table]:
    """All methods by name, in alphabetical order."""
    return {name: method(name) for name in names()}


@cache
def method(name: str) -> Table:
    """A method by name, for scenes and for `motes.ode`. Raises SceneError with the menu."""
    if name not in names():
        raise SceneError(
            f'no integrator "{name}".{likely(str(name), names())} There are: {", ".join(names())}.'
        )
    found: Table = importlib.import_module(f"{__name__}.{name}").method
    return found
