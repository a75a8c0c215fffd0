"""Named problems of ordinary differential equations, each with what one should look at in it."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.errors import SceneError, likely

Array = NDArray[np.float64]
Function = Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """y' = slope(t, y), or x'' = acceleration(t, x, v) for y = (x, v), from `start` over `span`."""

    start: tuple[float, ...]
    span: tuple[float, float]
    step: float
    """A step at which the methods below can be told apart."""

    methods: tuple[str, ...]
    """Methods worth comparing on it."""

    slope: Function | None = None
    acceleration: Function | None = None
    axes: tuple[tuple[int, int], ...] = ((0, 1),)
    """Pairs of components that are drawn as paths."""

    labels: tuple[str, str] = ("x", "y")
    exact: Callable[[Array], Array] | None = None
    """States (k, n) at times (k,), where a formula is known."""

    energy: Callable[[Array], Array] | None = None
    """What the solution keeps, (k,), of states (k, n)."""

    @cached_property
    def size(self) -> int:
        """Number of components of x for a second-order problem, of y for others."""
        return len(self.start) // 2 if self.acceleration else len(self.start)

    def f(self, t: float, y: Array) -> Array:
        """y' of a flat state."""
        if self.acceleration is None:
            assert self.slope is not None
            return np.asarray(self.slope(t, y), float)
        x, v = y[: self.size], y[self.size :]
        return np.concatenate([v, np.asarray(self.acceleration(t, x, v), float)])


def names() -> tuple[str, ...]:
    """Names of all problems, in alphabetical order."""
    return tuple(sorted(m.name for m in pkgutil.iter_modules(__path__)))


def problem(name: str) -> Problem:
    """A problem by name.

    Raises:
        SceneError: there is no such problem.
    """
    if name not in names():
        menu = ", ".join(names())
        raise SceneError(f'no problem "{name}".{likely(name, names())} There are: {menu}.', "ode")
    found: Problem = importlib.import_module(f"{__name__}.{name}").problem
    return found


def about(name: str) -> str:
    """What a problem is for: the first paragraph of its text."""
    problem(name)
    text = importlib.import_module(f"{__name__}.{name}").__doc__ or ""
    return " ".join(text.split("\n\n")[0].split())
