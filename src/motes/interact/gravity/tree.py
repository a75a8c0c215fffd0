"""A linear octree: cells as rows of arrays, in depth-first order, with what they contain."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.morton import LEVELS, morton_order
from motes.interact.gravity.room import Room
from motes.jit import Calls, blocks, each, jit

START, END, FIRST, NUMBER = 0, 1, 2, 3
X, Y, Z, RADIUS, MASS = 0, 1, 2, 3, 4
LOW, BALL_RADIUS, SPREAD = 3, 6, 7
PULL, COUNT, CHILDREN = 8, 9, 10
BALL = 16

FEW = 4
"""Most particles in leaves that are much larger than usual.

Such a leaf has a side that is near to very many small cells, in all of which it would see particles
only, and expansions around its center hardly converge at its edge.
"""

FINER, LARGER = 1, 3
"""Levels from a usual leaf up to one that is much larger, and on to where each particle is alone:
the ball around two of these would hold most others."""

BLOCK = 1 << 14
"""Particles that a thread writes at a time."""

BRANCHES, LEAST = 64, 1024
"""Parts into which particles are divided before the rest is divided in parallel, about, and
particles of a part at least."""

WINDOW, WINDOWS = 1024, 64
"""Particles that are neighbours on the curve, and how many times as many are looked at to know the
usual level of leaves."""


class Tree(NamedTuple):
    """Particles in Morton order and the cells of their octree, as kernels take them.

    A cell has NUMBER children, rows from FIRST on, and after them come all their descendants, those
    of the first child first. A leaf has none; its FIRST is where they would be.
    """

    leaves: NDArray[np.int32]
    """Rows of the leaves."""
    largest: int
    """Most particles in a leaf."""
    cells: NDArray[np.int32]
    """(cells, 4) particles START to END, and children from FIRST on, NUMBER of them."""
    bodies: NDArray[np.float64]
    """(cells, 5) center of mass, distance of the particle farthest from it, mass."""
    balls: NDArray[Any]
    """(cells + LANES, 16) the cells as the walk tests many: the center in two parts that sum to it,
    the radius, how far from the center the mass is: (sum m s^q / sum m)^(1/q) of distances s, with
    an even q of at least the order of expansions, the mass, and the numbers of particles and of
    children. The last rows are NOTHING. A row of single precision is a cache line."""
    order: NDArray[np.uint32]
    """(n,) row of each particle in the arrays that it came from."""
    place: NDArray[np.float64]
    """(4, n) x, y, z, m"""
    near: NDArray[Any]
    """(4 n + lanes,) for pairs, in single precision from the leaf's center: all x of a leaf's
    particles, then all y, z and m, from 4 START on, so that few lines of memory hold them."""
    moments: NDArray[Any]
    """(cells, padded basis)"""
    rounded: NDArray[Any]
    """The same in single precision, where it is wanted."""


@jit(inline=True)
def _first_of(key: Any, low: Any, high: Any, shift: Any, octant: Any) -> Any:
    """First row from `low` to `high` whose key has an octant of at least `octant` at a level."""
    while low < high:
        middle = (low + high) // 2
        if (key[middle] >> shift) & np.uint64(7) < octant:
            low = middle + 1
        else:
            high = middle
    return low


@jit(inline=True)
def _most(leaf: Any, level: Any, coarse: Any) -> Any:
    """Most particles in a leaf that fills a cube of a level."""
    few = FEW if level + LARGER >= coarse else 1
    return leaf if level >= coarse else few


@jit(numba=False)
def _divide(
    key: Any, leaf: Any, coarse: Any, limit: Any, roots: Any, written: Any, table: Any,
    branches: Any, which: Any,
) -> None:  # fmt: skip
    """Write the rows of a cell of `roots` and of what is under it.

    `roots` (k, 4) are particles START to END, a level, and anything. Rows are written to a table
    from row 2 START on; to `written` (k, 2) their number, and that of branches: cells of at most
    `limit` particles, which are not divided, but written to `branches` (b, 4), with their row.

    Leaves have at most `leaf` particles, or FEW if they fill a cube of a level under `coarse`, or
    one if it is LARGER levels under that.
    """
    root = roots[which]
    cells = table[2 * root[0] : 2 * root[1]]
    stack, cuts = np.empty((8 * LEVELS + 1, 2), np.int64), np.empty(8, np.int64)
    cells[0, START], cells[0, END] = root[0], root[1]
    stack[0, 0], stack[0, 1] = 0, root[2]
    depth, count, found = 1, 1, 0
    while depth > 0:
        depth -= 1
        cell, level = stack[depth]
        start, end = cells[cell, START], cells[cell, END]
        cells[cell, FIRST], cells[cell, NUMBER] = count, 0
        if end - start <= limit:
            branch = branches[found]
            branch[0], branch[1], branch[2], branch[3] = start, end, level, cell
            found += 1
            continue
        if end - start == 1 or (end - start <= FEW and level + LARGER >= coarse):
            continue
        shift = np.uint64(3 * (LEVELS - 1 - level))
        while level < LEVELS and key[start] >> shift == key[end - 1] >> shift:
            level += 1
            shift = np.uint64(3 * (LEVELS - 1 - level)) if level < LEVELS else np.uint64(0)
        if level == LEVELS or end - start <= _most(leaf, level, coarse):
            continue
        # From the last octant to the first.
        most = _most(leaf, level + 1, coarse)
        high, octant, number = end, np.uint64(8), 0
        while octant > 0:
            # The widest half, quarter or octant that ends here and has few enough for a leaf.
            width = np.uint64(4)
            while True:
                low = high
                if octant & (width - np.uint64(1)) == 0:
                    low = _first_of(key, start, high, shift, octant - width)
                    if width == 1 or high - low <= most:
                        break
                width >>= np.uint64(1)
            octant -= width
            if low < high:
                cuts[number] = low
                number += 1
                high = low
        cells[cell, NUMBER] = number
        for k in range(number):
            # The first child is on top of the stack, and so the next to be taken.
            child = count + number - 1 - k
            cells[child, START] = cuts[k]
            cells[child, END] = cuts[k - 1] if k > 0 else end
            stack[depth, 0], stack[depth, 1] = child, level + 1
            depth += 1
        count += number
    written[which, 0], written[which, 1] = count, found


@jit(numba=False)
def _find_levels(key: Any, some: Any, cells: Any, counts: Any, levels: Any, k: Any) -> None:
    """Count particles by the level of the cube around their leaf, but for leaves that are cut."""
    first, last = some[k, 0], some[k, 1]
    for cell in range(2 * first, 2 * first + counts[k, 0]):
        start, end = cells[cell, START], cells[cell, END]
        is_whole = (start > first or start == 0) and (end < last or end == key.size)
        if cells[cell, NUMBER] == 0 and (is_whole or end - start == last - first):
            level, shift = 0, np.uint64(3 * (LEVELS - 1))
            while level < LEVELS and key[start] >> shift == key[end - 1] >> shift:
                level += 1
                shift = np.uint64(3 * (LEVELS - 1 - level)) if level < LEVELS else np.uint64(0)
            levels[k, level] += end - start


@jit(numba=False)
def _number(stem: Any, branches: Any, parts: Any, counts: Any, cells: Any, after: Any) -> None:
    """Write the cells of the stem and the branches' own, in depth-first order, and where those
    under each branch are to be."""
    # Rows in the stem and in the end.
    stack = np.empty((8 * LEVELS + 1, 2), np.int64)
    stack[0] = 0
    depth, count, branch = 1, 1, 0
    while depth > 0:
        depth -= 1
        old, cell = stack[depth]
        first, number = stem[old, FIRST], stem[old, NUMBER]
        cells[cell, START], cells[cell, END] = stem[old, START], stem[old, END]
        cells[cell, FIRST], cells[cell, NUMBER] = count, number
        if branch < counts.shape[0] and branches[branch, 3] == old:
            cells[cell, NUMBER] = parts[2 * branches[branch, 0], NUMBER]
            after[branch] = count
            count += counts[branch, 0] - 1
            branch += 1
            continue
        for k in range(number):
            child = number - 1 - k
            stack[depth, 0], stack[depth, 1] = first + child, count + child
            depth += 1
        count += number


@jit(numba=False)
def _move_branch(branches: Any, parts: Any, counts: Any, after: Any, cells: Any, k: Any) -> None:
    """Write the cells under a branch, which know each other's rows."""
    start, shift = 2 * branches[k, 0], after[k] - 1
    for i in range(1, counts[k, 0]):
        old, new = parts[start + i], cells[shift + i]
        new[START], new[END], new[NUMBER] = old[START], old[END], old[NUMBER]
        new[FIRST] = old[FIRST] + shift


@jit(inline=True)
def cell_unit(radius: Any) -> Any:
    """Unit of length of a cell's expansions: its radius, or any positive length for a point."""
    return max(radius, 1e-12)


@dataclass(frozen=True)
class Box:
    """The cube that a tree divides, and the unit of length inside."""

    low: NDArray[np.float64]
    """(3,) corner with the smallest coordinates."""
    size: float
    """Edge, not 0."""
    length: float
    """Unit of length of the tree's coordinates."""
    mass: float = 1.0
    """Unit of mass in the tree."""

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) where the tree's coordinates are 0, such that differences from there are exact.

        That is the corner where all coordinates are at most twice it or it at most twice them
        (Sterbenz, Floating-point computation, 1974, theorem 4.3.1), and 0 where the cube is nearer.
        """
        is_far = (self.low >= self.size) | (self.low <= -2 * self.size)
        return np.where(is_far, self.low, 0.0)


def octree(
    points: NDArray[Any], mass: NDArray[np.float64], box: Box, leaf: int, room: Room | None = None
) -> Tree:
    """Sort and divide particles (n, 3) with masses (n,) until no leaf has more than `leaf`.

    Particles that share a key, closer than 2^-21 of the box, stay in one leaf. The pieces "records"
    and "key" of the room are free again afterwards.
    """
    room = room or Room()
    units = box.origin, box.length, box.mass
    key, order, place = morton_order(points, mass, box.low, box.size, *units, room)
    cells = _cells(key, leaf, room)
    nothing = np.empty((0, 0))
    return Tree(
        *_leaves(cells),
        cells,
        room.array("bodies", (len(cells), 5)),
        nothing,
        order,
        place,
        nothing,
        nothing,
        nothing,
    )


def regrown(
    points: NDArray[Any], mass: NDArray[np.float64], box: Box, like: Any, room: Room | None = None
) -> Tree:
    """The tree with the cells of another one of as many particles, wherever these are now.

    `like` has an order, cells, leaves, and the most particles in one.
    """
    room = room or Room()
    place = room.columns("place", 4, len(points))
    given = points, mass, box.origin, box.length, box.mass, like.order, place
    each(_permute, given, blocks(len(points), BLOCK))
    nothing = np.empty((0, 0))
    return Tree(
        like.leaves,
        like.largest,
        like.cells,
        room.array("bodies", (len(like.cells), 5)),
        nothing,
        like.order,
        place,
        nothing,
        nothing,
        nothing,
    )


@jit(numba=False)
def _permute(
    points: Any, mass: Any, origin: Any, length: Any, unit: Any, order: Any, place: Any,
    first: Any, last: Any,
) -> None:  # fmt: skip
    for i in range(first, last):
        k = order[i]
        for axis in range(3):
            place[axis, i] = (points[k, axis] - origin[axis]) / length
        place[3, i] = mass[k] / unit


def _cells(key: NDArray[np.uint64], leaf: int, room: Room) -> NDArray[np.int32]:
    """All cells: those above the branches, then what is in each of these, then put together."""
    n = len(key)
    limit = max(n // BRANCHES, leaf, LEAST)
    # An inner cell has more particles than one of its children, and at least two of these.
    parts = room.array("records", (2 * n, 4), np.int32)
    most = 8 * LEVELS * (n // limit) + 1
    stem, branches = np.empty((most, 4), np.int32), np.empty((most, 4), np.int64)
    coarse = _usual_level(key, leaf, parts) - FINER
    root = np.array([[0, n, 0, 0]])
    counts = np.empty((most, 2), np.int64)
    _divide(key, leaf, coarse, limit, root, counts, stem, branches, 0)
    count, found = counts[0]
    branches, counts, nothing = branches[:found], counts[:found], branches[:0]
    each(_divide, (key, leaf, coarse, 0, branches, counts, parts, nothing), _each_of(found))
    count += counts[:, 0].sum() - found
    cells: NDArray[np.int32] = room.array("cells", (int(count), 4), np.int32)
    after = np.empty(found, np.int64)
    _number(stem, branches, parts, counts, cells, after)
    each(_move_branch, (branches, parts, counts, after, cells), _each_of(found))
    return cells


def _usual_level(key: NDArray[np.uint64], leaf: int, parts: NDArray[np.int32]) -> int:
    """Level of the cube around the leaf of the median particle, leaves sorted by that.

    Of many particles, some here and there are divided to know it.
    """
    n = len(key)
    number = min(max(n // WINDOW, 1), WINDOWS)
    starts = np.arange(number) * n // number
    ends = starts + WINDOW if number > 1 else np.array([n])
    some = np.stack([starts, ends, 0 * starts, 0 * starts], axis=1)
    counts, levels = np.empty((number, 2), np.int64), np.zeros((number, LEVELS + 1), np.int64)
    each(_divide, (key, leaf, 0, 0, some, counts, parts, some[:0]), _each_of(number))
    each(_find_levels, (key, some, parts, counts, levels), _each_of(number))
    particles = levels.sum(axis=0)
    return int(np.searchsorted(2 * np.cumsum(particles), particles.sum()))


def _each_of(number: int) -> Calls:
    return Calls([(k,) for k in range(number)], alike=True)


def _leaves(cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
    """Rows of the leaves, and the most particles in one."""
    leaves = np.flatnonzero(cells[:, NUMBER] == 0).astype(np.int32)
    return leaves, int((cells[leaves, END] - cells[leaves, START]).max())
