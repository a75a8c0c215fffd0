"""A linear octree: cells as rows of arrays, in depth-first order, with what they contain."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.morton import LEVELS, morton_order
from motes.jit import blocks, jit, share

START, END, FIRST, NUMBER = 0, 1, 2, 3
X, Y, Z, RADIUS, MASS = 0, 1, 2, 3, 4
LOW, BALL_RADIUS, SPREAD = 3, 6, 7
PULL, COUNT, CHILDREN = 0, 1, 2

FEW = 4
"""Most particles in leaves that are much larger than usual.

Such a leaf has a side that is near to very many small cells, in all of which it would see particles
only, and expansions around its center hardly converge at its edge.
"""

FINER = 1
"""Levels from a usual leaf up to one that is much larger."""


class Tree(NamedTuple):
    """Particles in Morton order and the cells of their octree, as kernels take them.

    A cell has NUMBER children, rows from FIRST on, and after them come all their descendants, those
    of the first child first. A leaf has none; its FIRST is where they would be.
    """

    leaves: NDArray[np.int32]
    """Rows of the leaves."""
    cells: NDArray[np.int32]
    """(cells, 4) particles START to END, and children from FIRST on, NUMBER of them."""
    bodies: NDArray[np.float64]
    """(cells, 5) center of mass, distance of the particle farthest from it, mass."""
    balls: NDArray[Any]
    """(cells + LANES, 8) the cells as the walk tests many: the center in two parts that sum to it,
    the radius, and how far from the center the mass is: (sum m s^q / sum m)^(1/q) of distances s,
    with an even q of at least the order of expansions. The last rows are NOTHING."""
    contents: NDArray[Any]
    """(cells + LANES, 4) and as it weighs them: mass, number of particles, of children, and 0."""
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
    return Tree(
        _leaves(cells),
        cells,
        np.empty((len(cells), 5)),
        nothing,
        nothing,
        order,
        place,
        nothing,
        nothing,
    )


def _cells(key: NDArray[np.uint64], leaf: int, coarse: int) -> NDArray[np.int32]:
    capacity, count = 64 + 4 * len(key) // leaf, 0
    while not count:
        capacity *= 2
        cells: NDArray[np.int32] = np.empty((capacity, 4), np.int32)
        count = _divide(key, leaf, coarse, cells)
    return cells[:count].copy()


def _leaves(cells: NDArray[np.int32]) -> NDArray[np.int32]:
    found = np.empty(len(cells), np.int32)
    return found[: _find_leaves(cells, found)]


@jit(numba=False)
def _find_leaves(cells: Any, found: Any) -> Any:
    count = 0
    for cell in range(cells.shape[0]):
        if cells[cell, NUMBER] == 0:
            found[count] = cell
            count += 1
    return count


@jit(numba=False)
def _usual_level(key: Any, cells: Any) -> Any:
    """Level of the cube around the leaf of the median particle, leaves sorted by that."""
    particles = np.zeros(LEVELS + 1, np.int64)
    for cell in range(cells.shape[0]):
        if cells[cell, NUMBER] == 0:
            start, end = cells[cell, START], cells[cell, END]
            level, shift = 0, np.uint64(3 * (LEVELS - 1))
            while level < LEVELS and key[start] >> shift == key[end - 1] >> shift:
                level += 1
                shift = np.uint64(3 * (LEVELS - 1 - level)) if level < LEVELS else np.uint64(0)
            particles[level] += end - start
    level, below = 0, particles[0]
    while 2 * below < key.size:
        level += 1
        below += particles[level]
    return level


def largest_leaf(tree: Tree) -> int:
    """Most particles in a leaf."""
    counts = tree.cells[tree.leaves, END] - tree.cells[tree.leaves, START]
    return int(counts.max())
