"""A linear octree: cells as rows of arrays, in depth-first order, with what they contain."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.expansions import Tables
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.morton import LEVELS, morton_order
from motes.interact.gravity.translations import (
    Bench,
    bench,
    moments_to_moments,
    particles_to_moments,
)
from motes.jit import blocks, jit, share

START, END, SKIP = 0, 1, 2
X, Y, Z, RADIUS, MASS = 0, 1, 2, 3, 4

FEW = 8
"""Most particles in leaves that are much larger than usual.

Such a leaf has a side that is near to very many small cells, in all of which it would see particles
only, and expansions around its center hardly converge at its edge.
"""

FINER = 3
"""Levels from a usual leaf up to one that is much larger."""

LIGHT = 1e-30
"""Weight of massless particles in a center, where the masses of all are about 1."""


class Tree(NamedTuple):
    """Particles in Morton order and the cells of their octree, as kernels take them.

    A cell's children are the row after it, that one's SKIP, that one's SKIP ... until the cell's
    own SKIP; a leaf's SKIP is the row after it.
    """

    cells: NDArray[np.int32]
    """(cells, 3) particles START to END, and SKIP, the row after the last descendant."""
    bodies: NDArray[np.float64]
    """(cells, 5) center of mass, distance of the particle farthest from it, mass."""
    order: NDArray[np.uint32]
    """(n,) row of each particle in the arrays that it came from."""
    place: NDArray[np.float64]
    """(4, n) x, y, z, m"""
    near: NDArray[Any]
    """(4, n + lanes) x, y, z, m for pairs: in single precision from the leaf's center."""
    moments: NDArray[Any]
    """(cells, basis)"""


@jit
def _divide(key: Any, leaf: Any, coarse: Any, cells: Any) -> Any:
    """Write the rows of all cells; return their number, or 0 if there is no room.

    Leaves have at most `leaf` particles, or FEW if they fill a cube of a level under `coarse`.
    """
    stack = np.empty((8 * LEVELS + 1, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, key.size, 0
    depth, count = 1, 0
    while depth > 0:
        depth -= 1
        start, end, level = stack[depth]
        if count == cells.shape[0]:
            return 0
        cells[count, START], cells[count, END] = start, end
        count += 1
        if end - start <= FEW:
            continue
        shift = np.uint64(3 * (LEVELS - 1 - level))
        while level < LEVELS and key[start] >> shift == key[end - 1] >> shift:
            level += 1
            shift = np.uint64(3 * (LEVELS - 1 - level)) if level < LEVELS else np.uint64(0)
        if level == LEVELS or (end - start <= leaf and level >= coarse):
            continue
        high = end
        while high > start:
            octant = key[high - 1] >> shift
            low, above = start, high - 1
            while low < above:
                middle = (low + above) // 2
                if key[middle] >> shift < octant:
                    low = middle + 1
                else:
                    above = middle
            stack[depth, 0], stack[depth, 1], stack[depth, 2] = low, high, level + 1
            depth += 1
            high = low
    for back in range(count):
        cell = count - 1 - back
        after = cell + 1
        while after < count and cells[after, END] <= cells[cell, END]:
            after = cells[after, SKIP]
        cells[cell, SKIP] = after
    return count


@jit
def _permute(
    points: Any, mass: Any, low: Any, length: Any, order: Any, place: Any, first: Any, last: Any
) -> None:
    for i in range(first, last):
        k = order[i]
        place[0, i] = (points[k, 0] - low[0]) / length
        place[1, i] = (points[k, 1] - low[1]) / length
        place[2, i] = (points[k, 2] - low[2]) / length
        place[3, i] = mass[k]


@jit
def unpermute(sums: Any, order: Any, result: Any, first: Any, last: Any) -> None:
    """Write columns `first` to `last` of sums in the tree's order to where they came from."""
    for row in range(sums.shape[0]):
        for i in range(first, last):
            result[row, order[i]] = sums[row, i]


@jit
def _summarize(
    tree: Tree, first: Any, last: Any, table: Tables, bench: Bench, shifted: Any, relative: bool
) -> None:
    """Fill the rows of `bodies` and `moments` of cells `first` to `last`, children before parents.

    `shifted` (4, largest leaf) is working memory; `relative`: `tree.near` is from
    the leaf's center.
    """
    cells, bodies, place = tree.cells, tree.bodies, tree.place
    for back in range(last - first):
        cell = last - 1 - back
        start, end, skip = cells[cell, START], cells[cell, END], cells[cell, SKIP]
        is_leaf = skip == cell + 1
        mass = x = y = z = 0.0
        weights = LIGHT * (end - start)
        if is_leaf:
            for i in range(start, end):
                m = place[3, i]
                mass += m
                m += LIGHT
                x += m * place[0, i]
                y += m * place[1, i]
                z += m * place[2, i]
        else:
            child = cell + 1
            while child < skip:
                m = bodies[child, MASS]
                mass += m
                m += LIGHT * (cells[child, END] - cells[child, START])
                x += m * bodies[child, X]
                y += m * bodies[child, Y]
                z += m * bodies[child, Z]
                child = cells[child, SKIP]
        weights += mass
        x, y, z = x / weights, y / weights, z / weights
        r2 = 0.0
        for i in range(start, end):
            dx, dy, dz = place[0, i] - x, place[1, i] - y, place[2, i] - z
            r2 = max(r2, dx * dx + dy * dy + dz * dz)
        radius = np.sqrt(r2)
        bodies[cell, X], bodies[cell, Y], bodies[cell, Z] = x, y, z
        bodies[cell, RADIUS], bodies[cell, MASS] = radius, mass
        h = cell_unit(radius)
        if is_leaf:
            count = end - start
            for i in range(count):
                shifted[0, i] = place[0, start + i] - x
                shifted[1, i] = place[1, start + i] - y
                shifted[2, i] = place[2, start + i] - z
                shifted[3, i] = place[3, start + i]
            for row in range(4):
                for i in range(count):
                    tree.near[row, start + i] = (
                        shifted[row, i] if relative else place[row, start + i]
                    )
            if tree.moments.shape[0] > 0:
                scale = table.factor.dtype.type(1.0 / h)
                particles_to_moments(table, bench, shifted, count, scale, tree.moments[cell])
        elif tree.moments.shape[0] > 0:
            bench.place[:] = 0
            child, lane = cell + 1, 0
            while child < skip:
                bench.place[0, lane] = (x - bodies[child, X]) / h
                bench.place[1, lane] = (y - bodies[child, Y]) / h
                bench.place[2, lane] = (z - bodies[child, Z]) / h
                bench.place[3, lane] = 1
                bench.ratio[lane] = cell_unit(bodies[child, RADIUS]) / h
                for row in range(tree.moments.shape[1]):
                    bench.moments[row, lane] = tree.moments[child, row]
                child = cells[child, SKIP]
                lane += 1
            moments_to_moments(table, bench, tree.moments[cell])
        if tree.moments.shape[0] > 0:
            # Single precision would lose digits of the sum of many equal masses.
            tree.moments[cell, 0] = mass


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
    return Tree(cells, np.empty((len(cells), 5)), order, place, nothing, nothing)


def _cells(key: NDArray[np.uint64], leaf: int, coarse: int) -> NDArray[np.int32]:
    capacity, count = 64 + 4 * len(key) // leaf, 0
    while not count:
        capacity *= 2
        cells: NDArray[np.int32] = np.empty((capacity, 3), np.int32)
        count = _divide(key, leaf, coarse, cells)
    return cells[:count].copy()


def _usual_level(key: NDArray[np.uint64], cells: NDArray[np.int32]) -> int:
    """Level of the cube around the leaf of the median particle, leaves sorted by that."""
    leaves = cells[cells[:, SKIP] == np.arange(1, len(cells) + 1)]
    apart = key[leaves[:, START]] ^ key[leaves[:, END] - 1]
    level = LEVELS - np.ceil(np.frexp(apart.astype(np.float64))[1] / 3)
    order = np.argsort(level)
    share = np.cumsum((leaves[:, END] - leaves[:, START])[order])
    return int(level[order[np.searchsorted(share, share[-1] / 2)]])


def summarize(tree: Tree, table: Tables, real: type, sources: bool) -> Tree:
    """The tree with bodies, and for `sources` moments, filled in from places and masses."""
    branches, stem = divide_work(tree)
    count = len(tree.cells) if sources else 0
    near: NDArray[Any] = np.empty((4, tree.place.shape[1] + LANES), real)
    near[:, -LANES:] = 0
    tree = tree._replace(moments=np.zeros((count, len(table.kept)), real), near=near)
    largest = largest_leaf(tree)

    def fill(first: int, last: int) -> None:
        shifted: NDArray[Any] = np.empty((4, largest), real)
        _summarize(tree, first, last, table, bench(table, real), shifted, real is np.float32)

    share(lambda k: fill(branches[k], int(tree.cells[branches[k], SKIP])), len(branches))
    for cell in reversed(stem):
        fill(cell, cell + 1)
    return tree


def largest_leaf(tree: Tree) -> int:
    """Most particles in a leaf."""
    cells = tree.cells
    leaves = cells[:, SKIP] == np.arange(1, len(cells) + 1)
    return int((cells[leaves, END] - cells[leaves, START]).max())


def divide_work(tree: Tree) -> tuple[list[int], list[int]]:
    """Cells whose descendants are one task each, and the cells above them."""
    n = tree.place.shape[1]
    limit = min(max(n // 64, 64), 8192)
    branches, stem, cell = [], [], 0
    while cell < len(tree.cells):
        start, end, skip = (int(v) for v in tree.cells[cell])
        if end - start <= limit or skip == cell + 1:
            branches.append(cell)
            cell = skip
        else:
            stem.append(cell)
            cell += 1
    return branches, stem
