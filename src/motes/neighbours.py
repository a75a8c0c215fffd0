"""Neighbours of points: pairs within a radius, points around others, the nearest few.

All take points as arrays (n, 3) or (n, 2) in metres, in open space or in a periodic box. Distances
in a box are those of the nearest images: along each axis |a - b|, or what is left of the period if
that is less. They are calculated in the precision of the points, single or double, by nothing but
IEEE 754's operations, so that a result depends neither on the number of threads nor, but for the
names of rows, on the order of the points.

Points are sorted into cells by a stable counting sort, after Hockney and Eastwood, Computer
Simulation Using Particles (1988), section 8.4.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import index as index_of
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from motes.interact.search import Found

__all__ = ["nearest", "pairs", "within"]

Box = float | Sequence[float] | NDArray[Any] | None


def pairs(x: ArrayLike, radius: float, box: Box = None) -> tuple[NDArray[np.int32], ...]:
    """All pairs of points at most `radius` from each other, |x_i - x_j| <= radius, each once.

    `x`: (n, 3) or (n, 2) points [m]. `radius`: above 0 [m]. `box`: None, one period, or one for
    each dimension, infinite along open axes [m]; it begins at 0 and points are wrapped into it.

    Returns (i, j), rows of `x` with i < j, sorted by i, then by j. Raises ValueError for points or
    lengths that are not so, MemoryBudgetError where the pairs would not fit.
    """
    from motes.interact.search import Who

    return _pairs(_around(x, None, radius, box, Who.LATER))


def within(
    x: ArrayLike, radius: float, targets: ArrayLike | None = None, box: Box = None
) -> tuple[NDArray[np.int32], ...]:
    """All points at most `radius` from targets, |targets_i - x_j| <= radius.

    `x`: (n, 3) or (n, 2) points [m]. `targets`: (m, 3) or (m, 2) places [m]; without them, the
    points themselves, each without itself. `radius`, `box` and errors as in `pairs`.

    Returns (i, j), rows of `targets` and of `x`, sorted by i, then by j.
    """
    from motes.interact.search import Who

    return _pairs(_around(x, targets, radius, box, Who.ALL if targets is not None else Who.OTHERS))


def nearest(
    x: ArrayLike, k: int, box: Box = None, *, targets: ArrayLike | None = None
) -> tuple[NDArray[np.int32], NDArray[Any]]:
    """The k points nearest to each point or target, nearest first.

    `x`: (n, 3) or (n, 2) points [m]. `k`: at least 1. `targets`: (m, 3) or (m, 2) places [m];
    without them, the points themselves, each without itself. `box` and errors as in `pairs`.

    Returns (index, distance), each (m, k): rows of `x`, and distances [m]. Of points at the same
    distance, those of lower rows come first. Where there are fewer than k, -1 and infinity follow.
    """
    from motes.interact.cells import columns, period
    from motes.interact.nearest import nearest as search
    from motes.memory import allocate

    try:
        k = index_of(k)
    except TypeError:
        raise ValueError(f"k = {k!r} must be a whole number") from None
    if k < 1:
        raise ValueError(f"k = {k} must be at least 1")
    points, places = _points(x, targets)
    edges = period(box, points.shape[1], points.dtype.type)
    position, bounds = columns(points, edges, "x")
    goals = position
    if targets is not None:
        goals, others = columns(places, edges, "targets")
        bounds = _union(points, bounds, places, others)
    what = f"the {k} nearest of {len(places)} places"
    index, distance = (
        allocate((len(places), k), real, what) for real in (np.int32, points.dtype)
    )  # fmt: skip
    index.fill(-1)
    distance.fill(np.inf)
    wanted = min(k, len(points) - (targets is None))
    if wanted > 0 and len(places) > 0:
        own = targets is None
        found = search(position, goals, bounds, edges, wanted, own)
        index[:, :wanted], distance[:, :wanted] = found
    return index, distance


def _around(x: ArrayLike, targets: ArrayLike | None, radius: float, box: Box, who: Any) -> Found:
    """What is within a radius of targets, or of the points themselves."""
    from motes.interact.cells import columns, grid, numbers, period, sort
    from motes.interact.search import search

    points, places = _points(x, targets)
    length = numbers("radius", radius)
    if length.ndim:
        raise ValueError(f"radius must be one number, not of shape {length.shape}")
    if not 0 < radius < np.inf:
        raise ValueError(f"radius = {radius} must be above 0 and finite")
    edges = period(box, points.shape[1], points.dtype.type)
    position, bounds = columns(points, edges, "x")
    if targets is None:
        cut = grid(bounds, radius, edges)
        cells = sort(position, cut)
        return search(cells, cells, cut, radius, who)
    goals, others = columns(places, edges, "targets")
    cut = grid(_union(points, bounds, places, others), radius, edges)
    return search(sort(goals, cut), sort(position, cut), cut, radius, who)


def _pairs(found: Found) -> tuple[NDArray[np.int32], ...]:
    rows = np.arange(len(found.first) - 1, dtype=np.int32)
    return np.repeat(rows, np.diff(found.first)), found.row


def _points(x: ArrayLike, targets: ArrayLike | None) -> tuple[NDArray[Any], NDArray[Any]]:
    """Points and targets as arrays (n, 2) or (n, 3) of one precision."""
    from motes.interact.cells import numbers

    given = [("x", numbers("x", x))]
    if targets is not None:
        given.append(("targets", numbers("targets", targets)))
    single = all(array.dtype == np.float32 for _, array in given)
    arrays = []
    for name, array in given:
        if array.ndim != 2 or array.shape[1] not in (2, 3):
            raise ValueError(f"{name} must be (n, 3) or (n, 2), not {array.shape}")
        if len(array) >= 2**31:
            raise ValueError(f"{name} has {len(array)} rows; at most 2147483647 can be numbered")
        arrays.append(array.astype(np.float32 if single else np.float64, copy=False))
    if arrays[0].shape[1] != arrays[-1].shape[1]:
        shapes = " and ".join(str(array.shape) for array in arrays)
        raise ValueError(f"x and targets must have as many coordinates, not {shapes}")
    return arrays[0], arrays[-1]


def _union(
    points: NDArray[Any],
    bounds: NDArray[np.float64],
    places: NDArray[Any],
    others: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Bounds (2, 3) of both sets, either of which may be empty."""
    if not len(points) or not len(places):
        return bounds if len(points) else others
    return np.stack([np.minimum(bounds[0], others[0]), np.maximum(bounds[1], others[1])])
