"""A value that follows a curve over time, life, speed or a random number."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from motes.control.control import Control, Values
from motes.control.spline import Spline

SCOPE_OF = {
    "time": "scene",
    "random": "birth",
    "life": "particle",
    "speed": "particle",
    "order": "particle",
}
"""What a curve can run over, and the scope that this gives it.

`time` is the scene's time in seconds; `random` a uniform number from 0 to 1 drawn at birth; `life`
the age divided by the lifetime; `speed` the length of the velocity in m/s; `order`, for colours,
how much a particle's twelve nearest neighbours are a crystal's, from 0 to 1
(`motes.matter.local_order`).
"""

TABLE_SIZE = 256
"""Entries in the lookup table of a curve over life or speed."""


class Curve(Control):
    """A spline of numbers, vectors or colours over one of `SCOPE_OF`."""

    def __init__(self, over: str, spline: Spline, width: int, document: Any) -> None:
        self.over, self.spline, self.width = over, spline, width
        self.scope = SCOPE_OF[over]
        self._document = document

    def document(self) -> Any:
        """`{ over = "time", keys = [[t, value], ...] }`, or `stops` for colours."""
        return self._document

    def bounds(self) -> tuple[float, float]:
        """Exact extremes of the curve."""
        low, high = self.spline.bounds()
        return float(np.min(low)), float(np.max(high))

    def at(self, time: float) -> Values:
        """Value at a scene time, for a curve over time."""
        if self.over != "time":
            return super().at(time)
        return np.atleast_1d(np.asarray(self.spline(time), float))

    @property
    def span(self) -> tuple[float, float]:
        """First and last key [s, m/s, or a fraction]; a curve over life spans 0 to 1."""
        if self.over in ("life", "random", "order"):
            return 0.0, 1.0
        return float(self.spline.times[0]), float(self.spline.times[-1])

    @cached_property
    def table(self) -> Values:
        """The curve sampled at equal distances over its span, shape (TABLE_SIZE, width)."""
        low, high = self.span
        grid = np.linspace(low, high, TABLE_SIZE)
        return np.asarray(self.spline(grid), float).reshape(TABLE_SIZE, self.width)
