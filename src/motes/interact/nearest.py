"""The k nearest points of targets, by searches within a radius that grows for those left."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import Cells, Grid, grid, runs_around, sort
from motes.interact.search import TARGETS, candidates, collect, square, square_distance
from motes.jit import STRICT, blocks, jit, share

GROWTH = 2.0
"""Ratio of one radius to that before."""

CROWDED = 16
"""Points per cell, as one of them sees it, over the number wanted, at which cells are too large."""

SAMPLE = 1 << 12
"""Points, about, by which the first radius is chosen."""

HALVINGS = 50
"""Most tries of a smaller radius: where many points coincide none is small enough."""

_BALL = (1.0, 2.0, np.pi, 4 / 3 * np.pi)
"""Measure of a ball of radius 1 by dimension."""


@jit(inline=True, flags=STRICT)
def _measure(place: Any, box: Any, crosses: Any, points: Any, room: Any, far2: Any) -> None:
    x, y, z = place
    values = far2[:points]
    for q in range(values.size):
        values[q] = square_distance(x, y, z, room.position, q, box, crosses)


@jit(inline=True)
def _keep_least(far2: Any, row: Any, itself: Any, limit: Any, best: Any, index: Any) -> Any:
    """The least squares of distances up to `limit`, rising; of equal ones those of lower rows."""
    wanted, held, worst = best.size, 0, limit
    for q in range(far2.size):
        value = far2[q]
        if value > worst or row[q] == itself:
            continue
        if held == wanted and value == worst and row[q] > index[wanted - 1]:
            continue
        k = min(held, wanted - 1)
        while k > 0 and (best[k - 1] > value or (best[k - 1] == value and index[k - 1] > row[q])):
            best[k], index[k] = best[k - 1], index[k - 1]
            k -= 1
        best[k], index[k] = value, row[q]
        held = min(held + 1, wanted)
        if held == wanted:
            worst = best[wanted - 1]
    return held == wanted


@jit(flags=STRICT)
def _nearest(
    targets: Any,
    cells: Any,
    grid: Any,
    limit: Any,
    excluded: Any,
    begin: Any,
    end: Any,
    room: Any,
    far2: Any,
    best: Any,
    index: Any,
    done: Any,
) -> Any:
    """Serve targets from `begin` on; returns one without room, and the points it needs."""
    number, points, crosses = np.int64(0), np.int64(0), False
    for t in range(begin, end):
        if t == begin or targets.key[t] != targets.key[t - 1]:
            number, points, crosses = runs_around(targets.key[t], grid, cells, room.runs)
            if points > room.row.size:
                return t, points
            collect(cells, number, room)
        place = (targets.position[0, t], targets.position[1, t], targets.position[2, t])
        if crosses:
            _measure(place, grid.box, True, points, room, far2)
        else:
            _measure(place, grid.box, False, points, room, far2)
        i = targets.row[t]
        done[i] = _keep_least(far2[:points], room.row, excluded[i], limit, best[i], index[i])
    return end, np.int64(0)


def nearest(
    position: NDArray[Any],
    targets: NDArray[Any],
    bounds: NDArray[np.float64],
    box: NDArray[Any],
    wanted: int,
    own: bool,
) -> tuple[NDArray[np.int32], NDArray[Any]]:
    """Rows and distances (m, wanted) of the points (3, n) nearest to targets (3, m), nearest first.

    Of points at the same distance those of lower rows come first. `own` says that the targets are
    the points; none is its own neighbour. There must be at least `wanted` others.
    """
    n = targets.shape[1]
    index = np.empty((n, wanted), np.int32)
    best = np.empty((n, wanted), box.dtype)
    left = np.arange(n, dtype=np.int32)
    radius, cut, cells = _first_radius(position, bounds, box, wanted)
    while len(left):
        whole = len(left) == n
        sorted_targets = cells if own and whole else sort(targets[:, left], cut)
        excluded = left if own else np.full(len(left), -1, np.int32)
        part_best, part_index = (best, index) if whole else (best[left], index[left])
        done = _serve(sorted_targets, cells, cut, radius, excluded, part_best, part_index)
        if not whole:
            best[left], index[left] = part_best, part_index
        left = left[~done]
        if len(left):
            radius *= GROWTH
            cut = grid(bounds, radius, box)
            cells = sort(position, cut)
    return index, np.sqrt(best)


def _serve(
    targets: Cells,
    cells: Cells,
    cut: Grid,
    radius: float,
    excluded: NDArray[np.int32],
    best: NDArray[Any],
    index: NDArray[np.int32],
) -> NDArray[np.bool_]:
    """Fill rows of `best` and `index`; which targets have all that they want within `radius`."""
    real = cells.position.dtype.type
    done = np.zeros(len(best), np.bool_)
    limit = square(radius, real)
    parts = blocks(targets.row.size, TARGETS)

    def serve(part: int) -> None:
        begin, end = parts[part]
        points = 512
        while begin < end:
            room, far2 = candidates(2 * points, real), np.empty(2 * points, real)
            begin, points = _nearest(
                targets, cells, cut, limit, excluded, begin, end, room, far2, best, index, done
            )

    share(serve, len(parts))
    return done


def _first_radius(
    position: NDArray[Any], bounds: NDArray[np.float64], box: NDArray[Any], wanted: int
) -> tuple[float, Grid, Cells]:
    """A radius that holds the wanted number where points are densest, and its cells.

    It begins with what would do if most of a sample of the points filled their space evenly, and
    is halved while the points are in crowded cells.
    """
    n = position.shape[1]
    sample = position[:, :: max(1, n // SAMPLE)]
    spread = np.diff(np.quantile(sample.astype(np.float64), (0.1, 0.9), axis=1), axis=0)[0] / 0.8
    edges = spread[spread > 0] if np.any(spread > 0) else np.array([1.0])
    part = (wanted + 3 * np.sqrt(wanted)) / n / _BALL[len(edges)]
    radius = float(np.exp(np.log(edges).mean()) * part ** (1 / len(edges)))
    for _ in range(HALVINGS):
        cut = grid(bounds, radius, box)
        cells = sort(position, cut)
        starts = np.flatnonzero(np.diff(cells.key, prepend=cells.key[0] + np.uint64(1)))
        crowd = np.square(np.diff(starts, append=n), dtype=float).sum() / n
        if crowd <= CROWDED * wanted:
            break
        radius /= 2
    return radius, cut, cells
