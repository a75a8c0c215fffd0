"""The far field: what the expansions of source cells add to the local terms of a target cell."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import Desk
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.moments_to_local import moments_to_local
from motes.interact.gravity.translations import width
from motes.interact.gravity.tree import Tree
from motes.jit import EXACT, jit

LOW_DEGREE = 2
"""Highest degree of products in double precision in a mixture. Those of higher degree n are some
2^-n of the pull of a cell, and pulls of many cells are summed: their rounding is lost in it."""


def together(real: type, mixed: bool) -> int:
    """Number of source cells that are taken at a time."""
    return LANES if mixed else width(real)


@cache
def far_field(order: int, harmonic: bool, real: type, mixed: bool) -> Callable[..., None]:
    """Compiled function that adds the local terms of source cells to `desk.gathered`, `desk.high`.

    (sources, own, e2, far, count, desk) -> None: the first `count` cells of the list `far`, at most
    as many as go `together`, and of these what is left over is overwritten; `own` is the target's
    ball, and e2 the squared softening.
    """
    cells, half = together(real, mixed), width(np.float64)
    every_degree = moments_to_local(order, harmonic, real)
    low_degrees = moments_to_local(min(LOW_DEGREE, order), harmonic, np.float64)
    high_degrees = moments_to_local(order, harmonic, np.float32, above=LOW_DEGREE)

    @jit(flags=EXACT, numba=False)
    def expand(sources: Tree, own: Any, e2: Any, far: Any, count: Any, desk: Desk) -> None:
        for lane in range(count, cells):
            far[lane] = sources.cells.shape[0]
        balls, moments, local = sources.balls, sources.moments, desk.gathered
        if mixed:
            for first in range(0, count, half):
                some = far[first:]
                low_degrees(balls, some, own, moments, e2, desk.places, desk.room, local)
            if order > LOW_DEGREE:
                rounded, room, high = sources.rounded, desk.high_room, desk.high
                high_degrees(balls, far, own, rounded, e2, desk.places, room, high)
        else:
            every_degree(balls, far, own, moments, e2, desk.places, desk.room, local)

    return expand  # type: ignore[no-any-return]
