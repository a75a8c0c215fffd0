"""What a solver gives back, and what it is asked to watch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Event:
    """A function of time and state whose zeros are found: g(t, y), or g(t, x, v) for second order.

    Zeros are looked for in four equal parts of every step on the dense output, and located there to
    the last digit. A Numba function keeps a compiled solve compiled.
    """

    function: Callable[..., Any]
    direction: Literal[-1, 0, 1] = 0
    """1: only where g rises through 0; -1: only where it falls; 0: both."""

    terminal: bool = False
    """Whether the solve ends at the first such zero."""


@dataclass(frozen=True)
class Crossings:
    """Zeros of one event: times (k,) and states (k, ...)."""

    t: Array
    y: Array


@dataclass(frozen=True)
class Work:
    """What a solve cost, and how it ended."""

    evaluations: int
    """Calls of the right-hand side."""

    steps: int
    """Steps that were taken."""

    rejected: int
    """Steps whose estimated error was too large, and which were taken again, shorter."""

    success: bool
    """Whether the end, or a terminal event, was reached."""

    message: str
    """How the solve ended: why, where and in which component, if no step could be found."""


@dataclass(frozen=True)
class Solution(Work):
    """A solution of y' = f(t, y); called with times, it gives states between the steps, too."""

    t: Array
    """Times, (k,): those of `at`, or of every step, with the start."""

    y: Array
    """States, (k, ...)."""

    events: tuple[Crossings, ...] = ()
    """Zeros of each event."""

    dense: Callable[[Array], Array] | None = field(default=None, repr=False)

    def __call__(self, t: ArrayLike) -> Array:
        """States at times t of any shape: (..., shape of y).

        Raises:
            ValueError: a time outside of the solved span, or a solve with `dense=False`.
        """
        times = np.asarray(t, float)
        if self.dense is None:
            raise ValueError("the solve kept no steps: leave out dense=False")
        flat = self.dense(times.ravel())
        return flat.reshape(times.shape + flat.shape[1:])


@dataclass(frozen=True)
class NewtonSolution(Work):
    """A solution of x'' = a(t, x, v); called with times, it gives (x, v) between steps, too."""

    t: Array
    """Times, (k,)."""

    x: Array
    """Positions, (k, ...)."""

    v: Array
    """Velocities, (k, ...)."""

    events: tuple[Crossings, ...] = ()
    """Zeros of each event; their states are (k, 2, ...): position, velocity."""

    dense: Callable[[Array], Array] | None = field(default=None, repr=False)

    def __call__(self, t: ArrayLike) -> tuple[Array, Array]:
        """Positions and velocities at times t of any shape.

        Raises:
            ValueError: a time outside of the solved span, or a solve with `dense=False`.
        """
        times = np.asarray(t, float)
        if self.dense is None:
            raise ValueError("the solve kept no steps: leave out dense=False")
        flat = self.dense(times.ravel())
        both = flat.reshape(times.shape + flat.shape[1:])
        return np.take(both, 0, times.ndim), np.take(both, 1, times.ndim)
