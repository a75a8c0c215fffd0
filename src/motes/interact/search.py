"""All points within a radius of targets, as rows of numbers end to end."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import MOST_RUNS, Cells, Grid, apart, runs_around
from motes.jit import STRICT, blocks, jit, share
from motes.memory import afford, allocate

TARGETS = 1 << 12
"""Targets of one task."""

_FEW = 512
"""Neighbours up to which sorting in quadratic time, but by SIMD, is fastest."""

_GAPS = (701, 301, 132, 57, 23, 10, 4, 1)


LIST = "a list of neighbours"


class Who(IntEnum):
    """Which of the points within the radius of a target are wanted."""

    ALL = 0
    """All: the targets are another system's."""
    OTHERS = 1
    """All but the target itself."""
    LATER = 2
    """Those of higher rows than the target's: every pair once."""


class Found(NamedTuple):
    """Rows of points near targets: those of target t are `row[first[t]:first[t + 1]]`, rising."""

    first: NDArray[np.int64]
    """(targets + 1,)"""
    row: NDArray[np.int32]
    """(at least first[-1],)"""


class Candidates(NamedTuple):
    """Room for the points in and next to one cell."""

    runs: NDArray[np.int64]
    """(MOST_RUNS, 2) where they are in the order of cells."""
    position: NDArray[Any]
    """(3, points) [m]"""
    row: NDArray[np.int32]
    """(points,)"""
    near: NDArray[np.uint8]
    """(points,) 1 for those that are found."""


def candidates(points: int, real: Any) -> Candidates:
    """Room for a number of points."""
    return Candidates(
        np.empty((MOST_RUNS, 2), np.int64),
        np.empty((3, points), real),
        np.empty(points, np.int32),
        np.empty(points, np.uint8),
    )


def square(radius: float, real: Any) -> Any:
    """Square of a radius in a precision, infinite if it is too large for that [m2]."""
    with np.errstate(over="ignore"):
        return real(radius) * real(radius)


@jit(inline=True)
def collect(cells: Any, number: Any, room: Any) -> None:
    """Copy the points of the first `number` runs, for loops over them without gaps."""
    end = 0
    for k in range(number):
        low, high = room.runs[k, 0], room.runs[k, 1]
        begin, end = end, end + high - low
        for axis in range(3):
            old, new = cells.position[axis, low:high], room.position[axis, begin:end]
            for q in range(old.size):
                new[q] = old[q]
        rows, new_rows = cells.row[low:high], room.row[begin:end]
        for q in range(rows.size):
            new_rows[q] = rows[q]


@jit(inline=True, flags=STRICT)
def square_distance(x: Any, y: Any, z: Any, position: Any, q: Any, box: Any, crosses: Any) -> Any:
    """Square of the distance between a place and point q, or its nearest image [m2]."""
    dx = apart(x, position[0, q], box[0], crosses)
    dy = apart(y, position[1, q], box[1], crosses)
    dz = apart(z, position[2, q], box[2], crosses)
    return dx * dx + dy * dy + dz * dz


@jit(inline=True, flags=STRICT)
def _mark(
    place: Any, itself: Any, after: Any, limit: Any, box: Any, crosses: Any, points: Any, room: Any
) -> None:
    x, y, z = place
    near, row = room.near[:points], room.row[:points]
    for q in range(near.size):
        far2 = square_distance(x, y, z, room.position, q, box, crosses)
        near[q] = (far2 <= limit) & (row[q] > after) & (row[q] != itself)


@jit(flags=STRICT)
def _search(
    targets: Any,
    cells: Any,
    grid: Any,
    limit: Any,
    who: Any,
    begin: Any,
    end: Any,
    room: Any,
    count: Any,
    found: Any,
    total: Any,
) -> Any:
    """Append what is near targets from `begin` on to `found`, which holds `total`.

    Returns the first target that there is no room for, `total`, and the points next to it.
    """
    number, points, crosses = np.int64(0), np.int64(0), False
    for t in range(begin, end):
        if t == begin or targets.key[t] != targets.key[t - 1]:
            number, points, crosses = runs_around(targets.key[t], grid, cells, room.runs)
            if points > room.row.size:
                return t, total, points
            collect(cells, number, room)
        if total + points > found.size:
            return t, total, points
        place = (targets.position[0, t], targets.position[1, t], targets.position[2, t])
        itself = targets.row[t] if who != 0 else np.int32(-1)
        after = itself if who == 2 else np.int32(-1)
        if crosses:
            _mark(place, itself, after, limit, grid.box, True, points, room)
        else:
            _mark(place, itself, after, limit, grid.box, False, points, room)
        row, near, kept = room.row[:points], room.near[:points], found[total:]
        new = np.uint64(0)
        for q in range(row.size):
            kept[new] = row[q]
            new += np.uint64(near[q])
        count[t] = new
        total += np.int64(new)
    return end, total, np.int64(0)


@jit(inline=True)
def _by_rank(found: Any, row: Any) -> None:
    """Sort different numbers, each to the place of as many smaller ones: no branch, all SIMD."""
    for k in range(found.size):
        rank = np.int64(0)
        for q in range(found.size):
            rank += np.int64(found[q] < found[k])
        row[rank] = found[k]


@jit(inline=True)
def _by_gaps(found: Any, row: Any) -> None:
    """Shell's sort, with the gaps of Ciura (2001)."""
    row[:] = found
    for gap in _GAPS:
        for i in range(gap, row.size):
            value, k = row[i], i
            while k >= gap and row[k - gap] > value:
                row[k] = row[k - gap]
                k -= gap
            row[k] = value


@jit
def _arrange(target_row: Any, count: Any, found: Any, first: Any, row: Any) -> None:
    begin = np.int64(0)
    for t in range(count.size):
        length = np.int64(count[t])
        start, end = first[target_row[t]], begin + length
        if length <= _FEW:
            _by_rank(found[begin:end], row[start : start + length])
        else:
            _by_gaps(found[begin:end], row[start : start + length])
        begin = end


def search(
    targets: Cells,
    cells: Cells,
    grid: Grid,
    radius: float,
    who: Who,
    into: NDArray[np.int32] | None = None,
    spare: float = 1.0,
) -> Found:
    """Points within `radius` [m] of targets, which are sorted by the same grid.

    The rows go to `into` if that is large enough, else to a new array, `spare` times what it holds.
    """
    real = cells.position.dtype.type
    limit = square(radius, real)
    parts = blocks(targets.row.size, TARGETS)
    count = np.zeros(targets.row.size, np.int32)
    parcels: list[NDArray[np.int32]] = [np.empty(0, np.int32)] * len(parts)
    held = [0] * len(parts)

    def seek(part: int) -> None:
        begin, end = parts[part]
        room, found, total = candidates(512, real), np.empty(16 * TARGETS, np.int32), 0
        while begin < end:
            begin, total, points = _search(
                targets, cells, grid, limit, int(who), begin, end, room, count, found, total
            )
            if points > room.row.size:
                room = candidates(2 * points, real)
            if total + points > found.size:
                old, size = found, 2 * (total + points)
                held[part] = size
                afford(2 * found.itemsize * sum(held), LIST)  # What all find is copied once.
                found = allocate((size,), np.int32, LIST)
                found[:total] = old[:total]
        parcels[part] = found[:total]

    share(seek, len(parts))
    lengths = np.empty_like(count)
    lengths[targets.row] = count
    first = np.zeros(len(count) + 1, np.int64)
    np.cumsum(lengths, dtype=np.int64, out=first[1:])
    if into is None or into.size < first[-1]:
        into = allocate((int(spare * first[-1]),), np.int32, LIST)
    row = into

    def arrange(part: int) -> None:
        rows = slice(*parts[part])
        _arrange(targets.row[rows], count[rows], parcels[part], first, row)

    share(arrange, len(parts))
    return Found(first, row)
