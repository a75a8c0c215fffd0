"""Lists of neighbours of clusters: every slot within a radius of any of a cluster's particles.

The particles of a cluster share a list, so that its neighbours are gathered once into consecutive
memory and every particle's sum over them is a loop of vector instructions.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.arrange import Arranged
from motes.interact.cells import Grid, first_from
from motes.jit import STRICT, jit, share
from motes.memory import allocate

WIDTH = 16
"""Lists are filled up to a multiple of this: loops over them have no rest."""


class Part(NamedTuple):
    """The lists of consecutive clusters."""

    cluster: NDArray[np.int32]
    """(k + 1,) slots at which the clusters begin and, last, end."""
    first: NDArray[np.int64]
    """(k + 1,) where their lists begin in `entry` and, last, end."""
    entry: NDArray[np.int32]
    """Slots of neighbours; the slot after the last stands for nobody."""


class _Room(NamedTuple):
    """Candidates of one cluster."""

    position: NDArray[Any]
    slot: NDArray[np.int32]
    least: NDArray[Any]


def _room(points: int, real: Any) -> _Room:
    return _Room(np.empty((3, points), real), np.empty(points, np.int32), np.empty(points, real))


@jit(inline=True, flags=STRICT)
def _span(low: Any, high: Any, origin: Any, scale: Any, count: Any, wraps: Any) -> Any:
    """First cell and number of cells from a coordinate to another; they may go round the end."""
    first, last = np.floor((low - origin) * scale), np.floor((high - origin) * scale)
    if wraps:
        number = min(last - first + 1, np.float64(count))
        return np.int64(first - count * np.floor(first / count)), np.int64(number)
    first, last = max(first, np.float64(0)), min(last, np.float64(count - 1))
    return np.int64(first), np.int64(max(last - first + 1, np.float64(0)))


@jit(inline=True, flags=STRICT)
def _collect(low: Any, high: Any, cells: Any, grid: Any, begin: Any, points: Any, room: Any) -> Any:
    """Append the points of all cells that meet a box to the room, as far as it goes."""
    if cells.key.size == 0:
        return points
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    x, nx_around = _span(low[0], high[0], grid.low[0], grid.scale[0], nx, grid.wraps[0])
    y, ny_around = _span(low[1], high[1], grid.low[1], grid.scale[1], ny, grid.wraps[1])
    z, nz_around = _span(low[2], high[2], grid.low[2], grid.scale[2], nz, grid.wraps[2])
    for k in range(nz_around):
        for j in range(ny_around):
            row = ((z + k) % nz * ny + (y + j) % ny) * nx
            start, left = x, nx_around
            while left > 0:
                length = min(left, nx - start)
                first = first_from(np.uint64(row + start), cells)
                last = first_from(np.uint64(row + start + length), cells)
                if points + last - first <= room.slot.size:
                    for axis in range(3):
                        old = cells.position[axis, first:last]
                        new = room.position[axis, points : points + last - first]
                        for q in range(old.size):
                            new[q] = old[q]
                    slot = room.slot[points : points + last - first]
                    for q in range(slot.size):
                        slot[q] = np.int32(begin + first + q)
                points += last - first
                start, left = np.int64(0), left - length
    return points


@jit(flags=STRICT)
def _seek(
    position: Any,
    cluster: Any,
    cells: Any,
    ghosts: Any,
    grid: Any,
    radius: Any,
    begin: Any,
    room: Any,
    first: Any,
    entry: Any,
) -> Any:
    """Append lists of clusters from `begin` on; returns the first without, and room it needs."""
    real = position.dtype.type
    limit = real(radius) * real(radius)
    wide = radius * (1 + 2.0**-18)
    n = cells.key.size
    nobody = np.int32(n + ghosts.key.size)
    for c in range(begin, cluster.size - 1):
        a, b = cluster[c], cluster[c + 1]
        low = (position[0, a], position[1, a], position[2, a])
        high = low
        for i in range(a + 1, b):
            x, y, z = position[0, i], position[1, i], position[2, i]
            low = (min(low[0], x), min(low[1], y), min(low[2], z))
            high = (max(high[0], x), max(high[1], y), max(high[2], z))
        least = (np.float64(low[0]) - wide, np.float64(low[1]) - wide, np.float64(low[2]) - wide)
        most = (np.float64(high[0]) + wide, np.float64(high[1]) + wide, np.float64(high[2]) + wide)
        points = _collect(least, most, cells, grid, np.int64(0), np.int64(0), room)
        points = _collect(least, most, ghosts, grid, n, points, room)
        total = first[c]
        if points > room.slot.size or total + points + WIDTH > entry.size:
            return c, points
        near2 = room.least[:points]
        near2[:] = real(np.inf)
        xs, ys, zs = room.position[0][:points], room.position[1][:points], room.position[2][:points]
        for i in range(a, b):
            x, y, z = position[0, i], position[1, i], position[2, i]
            for q in range(near2.size):
                dx, dy, dz = x - xs[q], y - ys[q], z - zs[q]
                near2[q] = min(near2[q], dx * dx + dy * dy + dz * dz)
        slot, kept = room.slot[:points], entry[total:]
        new = np.uint64(0)
        for q in range(slot.size):
            kept[new] = slot[q]
            new += np.uint64(near2[q] <= limit)
        while new % np.uint64(WIDTH):
            kept[new] = nobody
            new += np.uint64(1)
        first[c + 1] = total + np.int64(new)
    return cluster.size - 1, np.int64(0)


def lists(
    targets: Arranged,
    sources: Arranged,
    cut: Grid,
    radius: float,
    old: list[Part] | None = None,
) -> list[Part]:
    """Every cluster's neighbours among the sources within `radius` [m], itself among them.

    Lists go into the memory of `old` ones where that is large enough.
    """
    position = targets.real.position
    real = position.dtype.type
    parts: list[Any] = [None] * len(targets.clusters)

    def seek(k: int) -> None:
        cluster = targets.clusters[k]
        first = np.zeros(cluster.size, np.int64)
        given = old[k].entry if old and k < len(old) else None
        entry = np.empty(32 * (cluster[-1] - cluster[0] + 1), np.int32) if given is None else given
        room, begin = _room(1024, real), 0
        while begin < cluster.size - 1:
            begin, points = _seek(
                position, cluster, sources.real, sources.ghosts, cut, float(radius),
                begin, room, first, entry,
            )  # fmt: skip
            if points > room.slot.size:
                room = _room(2 * points, real)
            if first[begin] + points + WIDTH > entry.size:
                share_done = (begin + 1) / (cluster.size - 1)
                size = int(1.2 * (first[begin] + points + WIDTH) / min(share_done, 1.0))
                larger = allocate((size,), np.int32, "a list of neighbours")
                larger[: first[begin]] = entry[: first[begin]]
                entry = larger
        parts[k] = Part(cluster, first, entry)

    share(seek, len(parts))
    return parts
