"""Particles of one system in the order of cells, with images beyond periodic borders, in clusters.

A place in that order is a slot. Beyond a periodic border stand ghosts: images of the particles near
the opposite border, in slots after the real ones, so that what looks for neighbours sees open
space. A cluster is a few particles next to one another in a row of cells: they share one list of
neighbours. After Páll and Hess, Computer Physics Communications 184 (2013) 2641.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import Cells, Grid, grid, sort
from motes.jit import STRICT, blocks, each, jit, share

FINER = 4.0
"""Cells per reach along x: what is near is in nine rows of cells along x, of which short
pieces are enough."""

CLUSTER = 8
"""Most particles of a cluster."""

SMALLEST_PART = 1 << 9
LARGEST_PART = 1 << 14
"""Particles of one task."""

ROWS = 1 << 15
"""Slots of one task of a loop that is quick."""

TOGETHER = 1 << 9
"""Particles that are looked through at once for some that have left the box."""

FEW = 1 << 12
"""Slots of one task of a loop that is not."""


class Box(NamedTuple):
    """A box that repeats along some axes."""

    low: NDArray[np.float64]
    """(3,) where it begins [m]."""
    size: NDArray[np.float64]
    """(3,) periods, 0 along open axes [m]."""

    @property
    def shortest(self) -> float:
        """The shortest period, infinite where there is none [m]."""
        return min((s for s in self.size.tolist() if s > 0), default=float("inf"))


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
    image: NDArray[np.uint8]
    """(g,) which of the 27 periodic boxes around a ghost is in."""
    shift: NDArray[Any]
    """(27, 3) ways from a particle to its images in the boxes around, itself in the middle [m]."""
    inner: NDArray[np.float64]
    """(2, 3) the box's lowest and highest coordinates; ghosts are outside [m]."""
    clusters: list[NDArray[np.int32]]
    """For each part of the slots, where its clusters begin and, last, where it ends."""

    @property
    def slots(self) -> int:
        """Real particles and ghosts."""
        return self.order.size + self.ghost_of.size


@jit(flags=STRICT)
def wrap(position: Any, low: Any, size: Any, begin: Any, end: Any) -> None:
    """Take coordinates into [low, low + size), in place."""
    for axis in range(3):
        first, length = low[axis], size[axis]
        for start in range(begin, end if length > 0 else begin, TOGETHER):
            x = position[axis][start : min(start + TOGETHER, end)]
            outside = 0
            for i in range(x.size):  # Counting is vector instructions.
                away = x[i] - first
                outside += (away < 0) | (away >= length)
            for i in range(x.size if outside else 0):
                away = x[i] - first
                if not (0 <= away < length):
                    value = x[i] - length * np.floor(away / length)
                    x[i] = value if first <= value < first + length else first


def wrapped(position: NDArray[Any], periodic: Box, count: int | None = None) -> None:
    """Take the first positions (3, n) [m], or all, into the box, in place."""
    if periodic.size.any():
        real = position.dtype.type
        head = position, periodic.low.astype(real), periodic.size.astype(real)
        each(wrap, head, blocks(position.shape[1] if count is None else count, ROWS))


def common_grid(positions: list[NDArray[Any]], reach: float, periodic: Box) -> Grid:
    """Cells for particles (3, n) within the box and their ghosts, narrower than the reach."""
    if positions and (periodic.size > 0).all():
        box = tuple(periodic.low.tolist()), tuple(periodic.size.tolist())
        return _closed_grid(*box, reach, positions[0].dtype)
    inside = [p for p in positions if p.shape[1]]
    low = np.min([p.min(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
    high = np.max([p.max(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
    low = np.where(periodic.size > 0, periodic.low - reach, low)
    high = np.where(periodic.size > 0, periodic.low + periodic.size + reach, high)
    real = positions[0].dtype if positions else np.float64
    return grid(
        np.stack([low, high]).astype(float), (reach / FINER, reach, reach), np.full(3, np.inf, real)
    )


@lru_cache(8)
def _closed_grid(low: tuple[float, ...], size: tuple[float, ...], reach: float, real: Any) -> Grid:
    """Cells of a box that repeats along all axes; wherever particles are, they are the same."""
    begin = np.array(low) - reach
    bounds = np.stack([begin, begin + np.array(size) + 2 * reach])
    return grid(bounds, (reach / FINER, reach, reach), np.full(3, np.inf, real))


def arrange(position: NDArray[Any], cut: Grid, reach: float, periodic: Box) -> Arranged:
    """Arrange particles (3, n) that lie within the box, with ghosts up to `reach` outside [m]."""
    real = sort(position, cut)
    shift = _boxes(periodic).astype(position.dtype)
    place, of, image = _ghosts(real.position, reach, periodic, shift)
    ghosts = sort(place, cut)
    edges = np.where(
        periodic.size > 0, [periodic.low, periodic.low + periodic.size], [[-np.inf], [np.inf]]
    )
    clusters = _clusters(real, cut, reach)
    of, image = of[ghosts.row], image[ghosts.row]
    return Arranged(real.row, real, ghosts, of, image, shift, edges, clusters)


def _ghosts(
    position: NDArray[Any], reach: float, periodic: Box, shift: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[np.uint8]]:
    """Places (3, g) of images beyond the borders, of whom they are images, and in which box."""
    size = periodic.size
    parts = blocks(position.shape[1], FEW) if size.any() else []
    low, high = periodic.low + reach, periodic.low + size - reach
    border = np.where(size > 0, [low, high], [[-np.inf], [np.inf]]).astype(position.dtype)
    counts = np.zeros(len(parts) + 1, np.int64)

    def count(k: int) -> None:
        counts[k + 1] = _count_images(position, border, *parts[k])

    share(count, len(parts))
    ends = np.cumsum(counts).tolist()
    place = np.empty((3, ends[-1]), position.dtype)
    of, image = np.empty(ends[-1], np.int32), np.empty(ends[-1], np.uint8)
    tails = [(*part, end, place, of, image) for part, end in zip(parts, ends[:-1], strict=True)]
    each(_write_images, (position, border, shift), tails)
    return place, of, image


_AROUND = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(27, 3)


def _boxes(periodic: Box) -> NDArray[np.float64]:
    """Ways (27, 3) from a particle to its images in the boxes around [m]; box 13 is its own."""
    found: NDArray[np.float64] = _AROUND * periodic.size
    return found


@jit(inline=True)
def _sides(x: Any, low: Any, high: Any) -> Any:
    """The first and the last of -1, 0, 1 by which a coordinate has images along an axis."""
    return -1 if x >= high else 0, 1 if x < low else 0


@jit(flags=STRICT)
def _count_images(position: Any, border: Any, begin: Any, end: Any) -> Any:
    x, y, z = position[0], position[1], position[2]
    x0, y0, z0 = border[0, 0], border[0, 1], border[0, 2]
    x1, y1, z1 = border[1, 0], border[1, 1], border[1, 2]
    total = 0
    for i in range(begin, end):  # Without a branch: vector instructions.
        images = 1 + (x[i] < x0) + (x[i] >= x1)
        images *= 1 + (y[i] < y0) + (y[i] >= y1)
        total += images * (1 + (z[i] < z0) + (z[i] >= z1)) - 1
    return total


@jit(flags=STRICT)
def _write_images(
    position: Any, border: Any, shift: Any, begin: Any, end: Any, new: Any, place: Any, of: Any,
    image: Any,
) -> None:  # fmt: skip
    for i in range(begin, end):
        x, y, z = position[0, i], position[1, i], position[2, i]
        x0, x1 = _sides(x, border[0, 0], border[1, 0])
        y0, y1 = _sides(y, border[0, 1], border[1, 1])
        z0, z1 = _sides(z, border[0, 2], border[1, 2])
        for a in range(x0, x1 + 1):
            for b in range(y0, y1 + 1):
                for c in range(z0, z1 + 1):
                    k = 9 * a + 3 * b + c + 13
                    if k != 13:
                        place[0, new] = x + shift[k, 0]
                        place[1, new] = y + shift[k, 1]
                        place[2, new] = z + shift[k, 2]
                        of[new], image[new] = np.int32(i), np.uint8(k)
                        new += 1


def part_size(n: int) -> int:
    """Slots of one task; from their number alone, so that threads change nothing."""
    return min(max(-(-n // 16), SMALLEST_PART), LARGEST_PART)


def _clusters(cells: Cells, cut: Grid, reach: float) -> list[NDArray[np.int32]]:
    n = cells.row.size
    parts = blocks(n, part_size(n))
    room, counts = np.empty(n + len(parts), np.int32), np.zeros(len(parts), np.int64)
    head = cells.key, cells.position[0], cut.shape[0], reach, counts, room
    each(_cut, head, [(k, *part) for k, part in enumerate(parts)])
    ends = zip(parts, counts.tolist(), strict=True)
    return [room[begin + k : begin + k + count] for k, ((begin, _), count) in enumerate(ends)]


@jit(flags=STRICT)
def _cut(
    key: Any, x: Any, along: Any, wide: Any, counts: Any, room: Any, part: Any, begin: Any,
    end: Any,
) -> None:  # fmt: skip
    """Begin a cluster where one is full, a row of cells ends, or it would be wider than `wide`."""
    number, start, row = 0, begin, np.int64(-1)
    left = right = x.dtype.type(0)
    first = room[begin + part :]
    for i in range(begin, end):
        own = np.int64(key[i]) // along
        if number:
            left, right = min(left, x[i]), max(right, x[i])
        if number == 0 or own != row or i - start == CLUSTER or right - left > wide:
            first[number] = i
            number, start, row, left, right = number + 1, i, own, x[i], x[i]
    first[number] = end
    counts[part] = number + 1


def packed_values(arranged: Arranged, values: NDArray[Any], out: NDArray[Any]) -> None:
    """Fill (slots + 1,) from values (rows,)."""
    parts = blocks(arranged.slots, ROWS)
    order, ghost_of = arranged.order, arranged.ghost_of
    share(lambda k: _take(values, order, ghost_of, out, *parts[k]), len(parts))
    out[-1] = out[0]


FAR = 1e15
"""A coordinate [m] further away than anything, whose square single precision still holds."""


@jit
def pack(
    position: Any, order: Any, then: Any, size: Any, mark: Any, out: Any, moved: Any, part: Any,
    begin: Any, end: Any,
) -> None:  # fmt: skip
    """Fill places (slots + 1, 4) from positions (3, rows): images near where they were arranged.

    Into `moved` go the squares of the longest ways that one has gone since it was arranged, and
    since it was at its `mark` (n, 4). The last place is nobody's.
    """
    if begin == 0:
        out[out.shape[0] - 1] = FAR
    most = far = out.dtype.type(0)
    marked = mark.shape[0] > 0
    for i in range(np.uint64(begin), np.uint64(end)):
        row = np.uint64(order[i])
        away2, since2 = out.dtype.type(0), out.dtype.type(0)
        for axis in range(3):
            x, old = position[axis, row], then[axis, i]
            away, period = x - old, size[axis]
            if period > 0 and abs(away) > period / 2:
                turns = period * np.round(away / period)
                x, away = x - turns, away - turns
            out[i, axis] = x
            away2 += away * away
            if marked:
                since2 += (x - mark[i, axis]) ** 2
        out[i, 3] = 0
        if not away2 <= most:
            most = away2  # Not a number counts as far.
        if not since2 <= far:
            far = since2
    moved[part, 0], moved[part, 1] = most, far


@jit
def pack_images(out: Any, of: Any, image: Any, shift: Any, n: Any, begin: Any, end: Any) -> None:
    """Fill places of ghosts from those of whom they are images."""
    for g in range(np.uint64(begin), np.uint64(end)):
        i, k, to = np.uint64(of[g]), np.uint64(image[g]), np.uint64(n) + g
        for axis in range(3):
            out[to, axis] = out[i, axis] + shift[k, axis]
        out[to, 3] = 0


@jit
def _take(values: Any, order: Any, ghost_of: Any, out: Any, begin: Any, end: Any) -> None:
    n = order.size
    for i in range(begin, end):
        slot = np.uint64(i if i < n else ghost_of[i - n])
        out[i] = values[np.uint64(order[slot])]
