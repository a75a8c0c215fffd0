"""A linear octree: cells as rows of arrays, in depth-first order, with what they contain."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.lanes import LANES, maximum, read, spread, write
from motes.interact.gravity.morton import LEVELS, morton_order
from motes.interact.gravity.translations import padded, translations
from motes.jit import EXACT, blocks, jit, share
from motes.machine.lanes import choose, largest

START, END, FIRST, NUMBER = 0, 1, 2, 3
X, Y, Z, RADIUS, MASS = 0, 1, 2, 3, 4
LOW, BALL_RADIUS, BALL_MASS = 3, 6, 7

FEW = 4
"""Most particles in leaves that are much larger than usual.

Such a leaf has a side that is near to very many small cells, in all of which it would see particles
only, and expansions around its center hardly converge at its edge.
"""

FINER = 1
"""Levels from a usual leaf up to one that is much larger."""

TASKS = 64
"""Parts of the upward pass."""

NOTHING = (8.0, 8.0, 8.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""A ball without mass, outside of the box: what lanes that are left over are about."""

LIGHT = 1e-30
"""Weight of massless particles in a center, where the masses of all are about 1."""


class Tree(NamedTuple):
    """Particles in Morton order and the cells of their octree, as kernels take them.

    A cell has NUMBER children, rows from FIRST on, and after them come all their descendants, those
    of the first child first. A leaf has none; its FIRST is where they would be.
    """

    cells: NDArray[np.int32]
    """(cells, 4) particles START to END, and children from FIRST on, NUMBER of them."""
    bodies: NDArray[np.float64]
    """(cells, 5) center of mass, distance of the particle farthest from it, mass."""
    balls: NDArray[Any]
    """(cells + LANES, 8) the same as the walk tests many: the center in two parts that sum to it,
    radius and mass; the last rows are NOTHING."""
    order: NDArray[np.uint32]
    """(n,) row of each particle in the arrays that it came from."""
    place: NDArray[np.float64]
    """(4, n) x, y, z, m"""
    near: NDArray[Any]
    """(4, n + lanes) x, y, z, m for pairs: in single precision from the leaf's center."""
    moments: NDArray[Any]
    """(cells, padded basis)"""


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


@jit(numba=False)
def _divide(key: Any, leaf: Any, coarse: Any, cells: Any) -> Any:
    """Write the rows of all cells; return their number, or 0 if there is no room.

    Leaves have at most `leaf` particles, or FEW if they fill a cube of a level under `coarse`.
    """
    stack, cuts = np.empty((8 * LEVELS + 1, 2), np.int64), np.empty(8, np.int64)
    cells[0, START], cells[0, END] = 0, key.size
    stack[0] = 0
    depth, count = 1, 1
    while depth > 0:
        depth -= 1
        cell, level = stack[depth]
        start, end = cells[cell, START], cells[cell, END]
        cells[cell, FIRST], cells[cell, NUMBER] = count, 0
        if end - start <= FEW:
            continue
        shift = np.uint64(3 * (LEVELS - 1 - level))
        while level < LEVELS and key[start] >> shift == key[end - 1] >> shift:
            level += 1
            shift = np.uint64(3 * (LEVELS - 1 - level)) if level < LEVELS else np.uint64(0)
        if level == LEVELS or (end - start <= leaf and level >= coarse):
            continue
        if count + 8 > cells.shape[0]:
            return 0
        # From the last octant to the first.
        most = leaf if level + 1 >= coarse else FEW
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
    return count


@jit(numba=False)
def _permute(
    points: Any, mass: Any, low: Any, length: Any, order: Any, place: Any, first: Any, last: Any
) -> None:
    for i in range(first, last):
        k = order[i]
        place[0, i] = (points[k, 0] - low[0]) / length
        place[1, i] = (points[k, 1] - low[1]) / length
        place[2, i] = (points[k, 2] - low[2]) / length
        place[3, i] = mass[k]


@jit(numba=False)
def unpermute(sums: Any, order: Any, result: Any, first: Any, last: Any) -> None:
    """Write columns `first` to `last` of sums in the tree's order to rows where they came from."""
    for i in range(first, last):
        place = order[i]
        for row in range(sums.shape[0]):
            result[place, row] = sums[row, i]


@jit(numba=False)
def _measure(tree: Tree, cell: Any) -> None:
    """Fill in a cell's body, its children's being there."""
    cells, bodies, place = tree.cells, tree.bodies, tree.place
    start, end, first_child, number = cells[cell]
    x = y = z = mass = 0.0
    weights = LIGHT * (end - start)
    if number == 0:
        for i in range(start, end):
            m = place[3, i]
            mass += m
            m += LIGHT
            x += m * place[0, i]
            y += m * place[1, i]
            z += m * place[2, i]
    else:
        for child in range(first_child, first_child + number):
            m = bodies[child, MASS]
            mass += m
            m += LIGHT * (cells[child, END] - cells[child, START])
            x += m * bodies[child, X]
            y += m * bodies[child, Y]
            z += m * bodies[child, Z]
    weights += mass
    x, y, z = x / weights, y / weights, z / weights
    xs, ys, zs = place[0, start:end], place[1, start:end], place[2, start:end]
    whole = xs.size // LANES * LANES
    most, r2 = spread(0.0), 0.0
    for i in range(0, whole, LANES):
        dx, dy, dz = read(xs, i) - x, read(ys, i) - y, read(zs, i) - z
        most = maximum(dx * dx + dy * dy + dz * dz, most)
    for i in range(whole, xs.size):
        dx, dy, dz = xs[i] - x, ys[i] - y, zs[i] - z
        r2 = max(r2, dx * dx + dy * dy + dz * dz)
    r2 = max(r2, largest(most))
    bodies[cell, X], bodies[cell, Y], bodies[cell, Z] = x, y, z
    bodies[cell, RADIUS], bodies[cell, MASS] = np.sqrt(r2), mass
    ball = tree.balls[cell]
    for axis in range(3):
        ball[axis] = bodies[cell, axis]
        ball[LOW + axis] = bodies[cell, axis] - ball[axis]
    ball[BALL_RADIUS], ball[BALL_MASS] = cell_unit(np.sqrt(r2)), mass


@jit(numba=False)
def _approach(tree: Tree, cell: Any, relative: bool) -> None:
    """Write a leaf's particles as the pairs see them."""
    start, end = tree.cells[cell, START], tree.cells[cell, END]
    for axis in range(3):
        old, new = tree.place[axis, start:end], tree.near[axis, start:end]
        center = tree.bodies[cell, axis] if relative else 0.0
        for i in range(old.size):
            new[i] = old[i] - center
    old, new = tree.place[3, start:end], tree.near[3, start:end]
    for i in range(old.size):
        new[i] = old[i]


@cache
def _summation(order: int, harmonic: bool) -> Callable[..., None]:
    """Compiled function that fills in bodies, near and moments of cells in ranges (k, 2).

    (tree, ranges, relative, place, chosen, ascending, sums) -> None; the last cell of a range is
    the first.
    """
    operations = translations(order, harmonic)
    particles_to_moments = operations.particles_to_moments
    sums_to_moments = operations.sums_to_moments
    moments_to_moments = operations.moments_to_moments

    @jit(flags=EXACT, numba=False)
    def moments_of_leaf(
        tree: Tree, cell: Any, relative: bool, place: Any, ascending: Any, sums: Any
    ) -> None:
        start, end = tree.cells[cell, START], tree.cells[cell, END]
        body, near, kind = tree.bodies[cell], tree.near, tree.near.dtype.type
        scale, zero = kind(1.0 / cell_unit(body[RADIUS])), kind(0)
        sums[:] = 0
        for first in range(start, end, LANES):
            inside = read(ascending, 0) < np.int32(end - first)
            for axis in range(3):
                center = kind(0.0 if relative else body[axis])
                away = (center - read(near[axis], first)) * scale
                write(place[axis], 0, choose(inside, away, zero))
            write(place[3], 0, choose(inside, read(near[3], first), zero))
            particles_to_moments(place, sums)
        sums_to_moments(sums, tree.moments[cell])

    @jit(flags=EXACT, numba=False)
    def moments_of_parent(tree: Tree, cell: Any, place: Any, chosen: Any) -> None:
        bodies = tree.bodies
        first, number = tree.cells[cell, FIRST], tree.cells[cell, NUMBER]
        body = bodies[cell]
        scale = 1.0 / cell_unit(body[RADIUS])
        for lane in range(LANES):
            child = first + lane
            chosen[lane] = first
            place[3, lane] = 0.0
            if lane < number:
                chosen[lane] = child
                place[0, lane] = (body[X] - bodies[child, X]) * scale
                place[1, lane] = (body[Y] - bodies[child, Y]) * scale
                place[2, lane] = (body[Z] - bodies[child, Z]) * scale
                place[3, lane] = 1.0
                place[4, lane] = cell_unit(bodies[child, RADIUS]) * scale
        moments_to_moments(place, chosen, tree.moments, tree.moments[cell])

    @jit(flags=EXACT, numba=False)
    def fill(
        tree: Tree, ranges: Any, relative: bool, place: Any, chosen: Any, ascending: Any, sums: Any
    ) -> None:
        for some in range(ranges.shape[0]):
            first, last = ranges[some, 0], ranges[some, 1]
            for back in range(last - first):
                cell = last - 1 - back
                is_leaf = tree.cells[cell, NUMBER] == 0
                _measure(tree, cell)
                if is_leaf:
                    _approach(tree, cell, relative)
                if tree.moments.shape[0] > 0:
                    if is_leaf:
                        moments_of_leaf(tree, cell, relative, place, ascending, sums)
                    else:
                        moments_of_parent(tree, cell, place, chosen)
                    # Single precision would lose digits of the sum of many equal masses.
                    tree.moments[cell, 0] = tree.bodies[cell, MASS]

    return fill  # type: ignore[no-any-return]


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
    """Unit of length of the tree's coordinates, which are from the corner."""


def octree(points: NDArray[Any], mass: NDArray[np.float64], box: Box, leaf: int) -> Tree:
    """Sort and divide particles (n, 3) with masses (n,) until no leaf has more than `leaf`.

    Particles that share a key, closer than 2^-21 of the box, stay in one leaf.
    """
    key, order = morton_order(points, box.low, box.size)
    n = len(key)
    cells = _cells(key, leaf, 0)
    cells = _cells(key, leaf, _usual_level(key, cells) - FINER)
    place = np.empty((4, n))
    ranges = blocks(n, 1 << 16)
    share(
        lambda k: _permute(points, mass, box.low, box.length, order, place, *ranges[k]),
        len(ranges),
    )
    nothing = np.empty((0, 0))
    return Tree(cells, np.empty((len(cells), 5)), nothing, order, place, nothing, nothing)


def _cells(key: NDArray[np.uint64], leaf: int, coarse: int) -> NDArray[np.int32]:
    capacity, count = 64 + 4 * len(key) // leaf, 0
    while not count:
        capacity *= 2
        cells: NDArray[np.int32] = np.empty((capacity, 4), np.int32)
        count = _divide(key, leaf, coarse, cells)
    return cells[:count].copy()


def _usual_level(key: NDArray[np.uint64], cells: NDArray[np.int32]) -> int:
    """Level of the cube around the leaf of the median particle, leaves sorted by that."""
    leaves = cells[cells[:, NUMBER] == 0]
    apart = key[leaves[:, START]] ^ key[leaves[:, END] - 1]
    level = LEVELS - np.ceil(np.frexp(apart.astype(np.float64))[1] / 3)
    order = np.argsort(level)
    share = np.cumsum((leaves[:, END] - leaves[:, START])[order])
    return int(level[order[np.searchsorted(share, share[-1] / 2)]])


def summarize(tree: Tree, order: int, harmonic: bool, real: type, sources: bool) -> Tree:
    """The tree with bodies, and for `sources` moments, filled in from places and masses."""
    branches, stem = divide_work(tree)
    operations, fill = translations(order, harmonic), _summation(order, harmonic)
    count = len(tree.cells) + 1 if sources else 0
    near: NDArray[Any] = np.empty((4, tree.place.shape[1] + LANES), real)
    near[:, -LANES:] = 0
    balls: NDArray[Any] = np.empty((len(tree.cells) + LANES, 8), real)
    balls[-LANES:] = NOTHING
    moments: NDArray[Any] = np.empty((count, padded(operations.basis)), real)
    moments[-1:] = 0  # Of rows that lanes which are left over are about.
    ascending = np.arange(LANES, dtype=np.int32)
    tree = tree._replace(moments=moments, near=near, balls=balls)

    def cells(ranges: Any) -> None:
        place: NDArray[Any] = np.ones((5, LANES), real)
        sums: NDArray[Any] = np.empty((operations.every, LANES), real)
        chosen = np.zeros(LANES, np.int32)
        given = np.asarray(ranges, np.int64).reshape(-1, 2)
        fill(tree, given, real is np.float32, place, chosen, ascending, sums)

    tasks = np.array_split(branches, min(len(branches), TASKS))

    def branch(k: int) -> None:
        some = tasks[k]
        ranges = np.empty((len(some), 2, 2), np.int64)
        ranges[:, 0, 0], ranges[:, 0, 1] = tree.cells[some[:, 0], FIRST], some[:, 1]
        ranges[:, 1, 0], ranges[:, 1, 1] = some[:, 0], some[:, 0] + 1
        cells(ranges)

    share(branch, len(tasks))
    cells([(cell, cell + 1) for cell in stem[::-1]])
    return tree


def largest_leaf(tree: Tree) -> int:
    """Most particles in a leaf."""
    cells = tree.cells
    leaves = cells[:, NUMBER] == 0
    return int((cells[leaves, END] - cells[leaves, START]).max())


def divide_work(tree: Tree) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cells whose descendants are one task each, (k, 2) with the row after the last of these; and
    the cells above them, each before its children."""
    limit = min(max(tree.place.shape[1] // 64, 64), 8192)
    branches = np.empty((len(tree.cells), 2), np.int64)
    stem = np.empty(len(tree.cells), np.int64)
    found, above = _divide_work(tree.cells, limit, branches, stem)
    return branches[:found], stem[:above]


@jit(numba=False)
def _divide_work(cells: Any, limit: Any, branches: Any, stem: Any) -> Any:
    waiting = np.empty(8 * LEVELS + 1, np.int64)
    waiting[0] = 0
    depth, found, above = 1, 0, 0
    while depth > 0:
        depth -= 1
        cell = waiting[depth]
        start, end, first, number = cells[cell]
        # What comes next in this order has its descendants after those of the last branch.
        if found > 0 and branches[found - 1, 1] == 0:
            branches[found - 1, 1] = first
        if end - start <= limit or number == 0:
            branches[found, 0], branches[found, 1] = cell, 0
            found += 1
        else:
            stem[above] = cell
            above += 1
            for back in range(number):
                waiting[depth] = first + number - 1 - back
                depth += 1
    branches[found - 1, 1] = cells.shape[0]
    return found, above
