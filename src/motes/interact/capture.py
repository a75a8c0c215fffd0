"""Hunters that catch their prey."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.catalog import Number, component, quantity

if TYPE_CHECKING:
    from motes.group.capture import Animals


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
        from motes.neighbours import nearest

        found = []
        for victims in prey:
            for hunter in hunters:
                if not victims.position.size or not hunter.position.size:
                    continue
                index, far = nearest(victims.position.T, 1, targets=hunter.position.T)
                drawn = luck(hunter.ids, victims.ids[index[:, 0]])
                caught = (far[:, 0] <= p.radius) & (drawn < -np.expm1(-p.rate * step))
                near = np.flatnonzero(caught)
                rows, first = np.unique(index[near, 0], return_index=True)
                found.append((hunter.name, near[first], victims.name, rows))
        return found
