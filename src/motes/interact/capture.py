"""Hunters that catch their prey."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.catalog import Number, component, quantity

if TYPE_CHECKING:
    from motes.group.capture import Animals

FEW = 1 << 14
"""Pairs that are looked at one by one."""


@component
class Capture:
    """Hunters catch what comes within a radius, and it dies: each the nearest one, one a step.

    While one is near, the chance of a capture in a time h is 1 - exp(-rate h). All that take part
    and are no hunters are prey. `Simulation.captures` tells who caught whom, when and where.
    """

    hunters: Any = quantity((), table="names")
    """Names of the systems that catch."""

    radius: Number = quantity(0.5, "m", above=0)
    """Distance within which one is caught."""

    rate: Number = quantity(1e6, "1/s", above=0)
    """Captures a second while one is near; a very high one misses nothing."""

    def captures(
        p: Any, hunters: Sequence[Animals], prey: Sequence[Animals], luck: Any, step: float
    ) -> list[Any]:
        """(hunter, its rows, prey, its rows) of those that are caught in a step of a length [s]."""
        found = []
        for victims in prey:
            for hunter in hunters:
                i, j = _nearest(hunter.position, victims.position, p.radius)
                drawn = luck(hunter.ids[i], victims.ids[j])
                caught = np.flatnonzero(drawn < -np.expm1(-p.rate * step))
                rows, first = np.unique(j[caught], return_index=True)
                found.append((hunter.name, i[caught][first], victims.name, rows))
        return found


def _nearest(hunters: Any, prey: Any, radius: float) -> tuple[Any, Any]:
    """Rows of hunters (3, m) with prey (3, n) within a radius [m], and of each one's nearest."""
    from motes.neighbours import within

    nobody = np.zeros(0, np.int64)
    if not hunters.size:
        return nobody, nobody
    low, high = hunters.min(axis=1) - radius, hunters.max(axis=1) + radius
    around = np.flatnonzero(((low <= prey.T) & (high >= prey.T)).all(axis=1))
    if not around.size:
        return nobody, nobody
    i: Any
    found: Any
    if hunters.shape[1] * around.size <= FEW:
        way = hunters[:, :, None] - prey[:, None, around]
        i, found = np.nonzero((way * way).sum(axis=0) <= radius * radius)
    else:
        i, found = within(prey[:, around].T, radius, targets=hunters.T)
    j = around[found]
    order = np.lexsort((j, np.square(hunters[:, i] - prey[:, j]).sum(axis=0), i))
    first = order[np.unique(i[order], return_index=True)[1]]
    return i[first], j[first]
