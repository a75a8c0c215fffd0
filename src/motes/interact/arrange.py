"""Particles of one system in the order of cells, with images beyond periodic borders, in clusters.

A place in that order is a slot. Beyond a periodic border stand ghosts: images of the particles near
the opposite border, in slots after the real ones, so that what looks for neighbours sees open
space. A cluster is a few particles next to one another in a row of cells: they share one list of
neighbours. After Páll and Hess, Computer Physics Communications 184 (2013) 2641.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import Cells, Grid, grid, sort
from motes.jit import STRICT, blocks, jit, share

FINER = 1.6
"""Cells per reach: finer ones make compact clusters, but there are more of them to look into."""

CLUSTER = 8
"""Most particles of a cluster."""

SMALLEST_PART = 1 << 11
LARGEST_PART = 1 << 14
"""Particles of one task."""

ROWS = 1 << 14
"""Slots of one task of a loop that is quick."""


class Box(NamedTuple):
    """A box that repeats along some axes."""

    low: NDArray[np.float64]
    """(3,) where it begins [m]."""
    size: NDArray[np.float64]
    """(3,) periods, 0 along open axes [m]."""

    @property
    def shortest(self) -> float:
        """The shortest period, infinite where there is none [m]."""
        return float(np.min(np.where(self.size > 0, self.size, np.inf)))


OPEN = Box(np.zeros(3), np.zeros(3))
"""Space without borders."""


class Arranged(NamedTuple):
    """One system's particles in slots: n real ones, then g ghosts."""

    order: NDArray[np.int32]
    """(n,) rows of the particles in the order of slots."""
    real: Cells
    ghosts: Cells
    ghost_of: NDArray[np.int32]
    """(g,) slots of the particles that ghosts are images of."""
    shift: NDArray[Any]
    """(3, g) from a particle to its image [m]."""
    inner: NDArray[np.float64]
    """(2, 3) the box's lowest and highest coordinates; ghosts are outside [m]."""
    clusters: list[NDArray[np.int32]]
    """For each part of the slots, where its clusters begin and, last, where it ends."""

    @property
    def slots(self) -> int:
        """Real particles and ghosts."""
        return self.order.size + self.ghost_of.size


@jit(flags=STRICT)
def wrap(x: Any, low: Any, size: Any) -> None:
    """Take coordinates into [low, low + size), in place."""
    for i in range(x.size):
        away = x[i] - low
        if not (0 <= away < size):
            value = x[i] - size * np.floor(away / size)
            x[i] = value if low <= value < low + size else low


def wrapped(position: NDArray[Any], periodic: Box) -> None:
    """Take positions (3, n) [m] into the box, in place."""
    real, axes = position.dtype.type, np.flatnonzero(periodic.size)
    low, size = periodic.low.astype(real), periodic.size.astype(real)
    share(lambda k: wrap(position[axes[k]], low[axes[k]], size[axes[k]]), len(axes))


def common_grid(positions: list[NDArray[Any]], reach: float, periodic: Box) -> Grid:
    """Cells for particles (3, n) within the box and their ghosts, narrower than the reach."""
    inside = [p for p in positions if p.shape[1]]
    low = np.min([p.min(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
    high = np.max([p.max(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
    low = np.where(periodic.size > 0, periodic.low - reach, low)
    high = np.where(periodic.size > 0, periodic.low + periodic.size + reach, high)
    real = positions[0].dtype if positions else np.float64
    return grid(np.stack([low, high]).astype(float), reach / FINER, np.full(3, np.inf, real))


def arrange(position: NDArray[Any], cut: Grid, reach: float, periodic: Box) -> Arranged:
    """Arrange particles (3, n) that lie within the box, with ghosts up to `reach` outside [m]."""
    real = sort(position, cut)
    slots = np.arange(position.shape[1], dtype=np.int32)
    shift = np.zeros((3, slots.size), position.dtype)
    for axis in np.flatnonzero(periodic.size):
        low, size = periodic.low[axis], periodic.size[axis]
        x = real.position[axis][slots]
        left, right = np.flatnonzero(x < low + reach), np.flatnonzero(x >= low + size - reach)
        chosen = np.concatenate([np.arange(slots.size), left, right])
        slots, shift = slots[chosen], shift[:, chosen]
        whole = chosen.size - left.size - right.size
        shift[axis, whole : whole + left.size] = size
        shift[axis, whole + left.size :] = -size
    slots, shift = slots[real.row.size :], shift[:, real.row.size :]
    ghosts = sort(real.position[:, slots] + shift, cut)
    clusters = _clusters(real, cut, reach)
    ghost_of = slots[ghosts.row]
    edges = np.where(
        periodic.size > 0, [periodic.low, periodic.low + periodic.size], [[-np.inf], [np.inf]]
    )
    return Arranged(real.row, real, ghosts, ghost_of, shift[:, ghosts.row], edges, clusters)


def part_size(n: int) -> int:
    """Slots of one task; from their number alone, so that threads change nothing."""
    return min(max(-(-n // 16), SMALLEST_PART), LARGEST_PART)


def _clusters(cells: Cells, cut: Grid, reach: float) -> list[NDArray[np.int32]]:
    n = cells.row.size
    found = []
    for begin, end in blocks(n, part_size(n)):
        room = np.empty(end - begin + 1, np.int32)
        found.append(
            room[: _cut(cells.key, cells.position[0], cut.shape[0], reach, begin, end, room)]
        )
    return found


@jit(flags=STRICT)
def _cut(key: Any, x: Any, along: Any, wide: Any, begin: Any, end: Any, first: Any) -> Any:
    """Begin a cluster where one is full, a row of cells ends, or it would be wider than `wide`."""
    number, start, row = 0, begin, np.int64(-1)
    left = right = x.dtype.type(0)
    for i in range(begin, end):
        own = np.int64(key[i]) // along
        if number:
            left, right = min(left, x[i]), max(right, x[i])
        if number == 0 or own != row or i - start == CLUSTER or right - left > wide:
            first[number] = i
            number, start, row, left, right = number + 1, i, own, x[i], x[i]
    first[number] = end
    return number + 1


class Packing(NamedTuple):
    """What tells where the particles of one system have gone since they were arranged."""

    arranged: Arranged
    periodic: Box

    def positions(self, position: NDArray[Any], out: NDArray[Any]) -> float:
        """Fill (3, slots + 1) from positions (3, rows), as images near where they were arranged.

        Returns the square of the longest way that one has gone [m2]. The last slot is a place far
        from everything, to fill lists up with.
        """
        arranged = self.arranged
        size = self.periodic.size.astype(out.dtype)
        parts = blocks(arranged.slots, ROWS)
        moved = np.zeros(len(parts) + 1)

        def pack(k: int) -> None:
            moved[k] = _pack(
                position, arranged.order, arranged.ghost_of, arranged.real.position,
                arranged.shift, size, out, *parts[k],
            )  # fmt: skip

        share(pack, len(parts))
        out[:, -1] = FAR
        return float(moved.max())

    def values(self, values: NDArray[Any], out: NDArray[Any]) -> None:
        """Fill (slots + 1,) from values (rows,)."""
        parts = blocks(self.arranged.slots, ROWS)
        order, ghost_of = self.arranged.order, self.arranged.ghost_of
        share(lambda k: _take(values, order, ghost_of, out, *parts[k]), len(parts))
        out[-1] = out[0]


FAR = 1e15
"""A coordinate [m] further away than anything, whose square single precision still holds."""


@jit
def _pack(
    position: Any, order: Any, ghost_of: Any, then: Any, shift: Any, size: Any, out: Any,
    begin: Any, end: Any,
) -> Any:  # fmt: skip
    most = out.dtype.type(0)
    n = order.size
    for i in range(begin, end):
        slot = np.uint64(i if i < n else ghost_of[i - n])
        row = np.uint64(order[slot])
        away2 = out.dtype.type(0)
        for axis in range(3):
            x, old = position[axis, row], then[axis, slot]
            away, period = x - old, size[axis]
            if period > 0 and abs(away) > period / 2:
                turns = period * np.round(away / period)
                x, away = x - turns, away - turns
            out[axis, i] = x if i < n else x + shift[axis, i - n]
            away2 += away * away
        if not away2 <= most:
            most = away2  # Not a number counts as far.
    return most


@jit
def _take(values: Any, order: Any, ghost_of: Any, out: Any, begin: Any, end: Any) -> None:
    n = order.size
    for i in range(begin, end):
        slot = np.uint64(i if i < n else ghost_of[i - n])
        out[i] = values[np.uint64(order[slot])]
