"""Time-stepping methods: each file is a table, `method`, and says in its text when to use it."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from motes.errors import SceneError, likely
from motes.tableau import Method


@cache
def methods() -> dict[str, Method]:
    """All methods by name, in alphabetical order."""
    names = sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_"))
    return {name: importlib.import_module(f"{__name__}.{name}").method for name in names}


def method(name: str) -> Method:
    """A method by name. Raises SceneError with the menu."""
    if name not in methods():
        menu = ", ".join(methods())
        raise SceneError(f'no integrator "{name}".{likely(name, methods())} There are: {menu}.')
    return methods()[name]
