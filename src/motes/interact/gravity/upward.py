"""The upward pass: what the cells of a tree contain, from their particles and their children."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.lanes import LANES, maximum, read, spread, write
from motes.interact.gravity.morton import LEVELS
from motes.interact.gravity.room import Room
from motes.interact.gravity.translations import FAMILY, padded, translations, width
from motes.interact.gravity.tree import (
    BALL,
    BALL_RADIUS,
    CHILDREN,
    COUNT,
    END,
    FIRST,
    LOW,
    MASS,
    NUMBER,
    PULL,
    RADIUS,
    SPREAD,
    START,
    Tree,
    X,
    Y,
    Z,
    cell_unit,
)
from motes.jit import EXACT, each, jit
from motes.machine.lanes import choose, largest, take, total

TASKS, PARTICLES_OF_A_TASK = 64, 4096
"""Parts of the upward pass, at most, and particles of a part at least."""

NOTHING = (8.0, 8.0, 8.0, 0.0, 0.0, 0.0, 1.0) + 9 * (0.0,)
"""A ball without mass, outside of the box: what lanes that are left over are about."""

MANY = 500
"""Most particles of a cell with children whose ball is the smallest around its center of mass. A
larger one follows from its children's balls: it may be too large, which makes errors smaller."""

LIGHT = 1e-30
"""Weight of massless particles in a center, where the masses of all are about 1."""


@cache
def _measurer(order: int) -> Callable[..., None]:
    """Compiled function that fills in a cell's body, its children's being there."""
    squares = (order + 1) // 2
    root = 0.5 / squares

    @jit(inline=True, flags=EXACT)
    def raised(square: Any) -> Any:
        """s^q from s^2."""
        power = square
        for _ in range(squares - 1):
            power = power * square
        return power

    @jit(flags=EXACT, numba=False)
    def measure(tree: Tree, cell: Any) -> None:
        cells, bodies, place = tree.cells, tree.bodies, tree.place
        start, end, first_child, number = cells[cell]
        xs, ys, zs = place[0, start:end], place[1, start:end], place[2, start:end]
        ms = place[3, start:end]
        whole = xs.size // LANES * LANES
        # From the first particle on: where all are at one place, so is their center, to the bit.
        x0, y0, z0 = xs[0], ys[0], zs[0]
        x = y = z = mass = 0.0
        if number == 0:
            sum_x, sum_y, sum_z, sum_m = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
            for i in range(0, whole, LANES):
                m = read(ms, i)
                weight = m + LIGHT
                sum_m = sum_m + m
                sum_x = sum_x + weight * (read(xs, i) - x0)
                sum_y = sum_y + weight * (read(ys, i) - y0)
                sum_z = sum_z + weight * (read(zs, i) - z0)
            x, y, z, mass = total(sum_x), total(sum_y), total(sum_z), total(sum_m)
            for i in range(whole, xs.size):
                m = ms[i]
                mass += m
                m += LIGHT
                x += m * (xs[i] - x0)
                y += m * (ys[i] - y0)
                z += m * (zs[i] - z0)
        else:
            for child in range(first_child, first_child + number):
                m = bodies[child, MASS]
                mass += m
                m += LIGHT * (cells[child, END] - cells[child, START])
                x += m * (bodies[child, X] - x0)
                y += m * (bodies[child, Y] - y0)
                z += m * (bodies[child, Z] - z0)
        weights = mass + LIGHT * (end - start)
        x, y, z = x0 + x / weights, y0 + y / weights, z0 + z / weights
        r2, radius, spread_out = 0.0, 0.0, 0.0
        if number == 0 or end - start <= MANY:
            far, sums = spread(0.0), spread(0.0)
            for i in range(0, whole, LANES):
                dx, dy, dz = read(xs, i) - x, read(ys, i) - y, read(zs, i) - z
                s2 = dx * dx + dy * dy + dz * dz
                far = maximum(s2, far)
                sums = sums + read(ms, i) * raised(s2)
            for i in range(whole, xs.size):
                dx, dy, dz = xs[i] - x, ys[i] - y, zs[i] - z
                s2 = dx * dx + dy * dy + dz * dz
                r2 = max(r2, s2)
                spread_out += ms[i] * raised(s2)
            radius = np.sqrt(max(r2, largest(far)))
            spread_out += total(sums)
        else:
            for child in range(first_child, first_child + number):
                dx, dy, dz = bodies[child, X] - x, bodies[child, Y] - y, bodies[child, Z] - z
                away = np.sqrt(dx * dx + dy * dy + dz * dz)
                radius = max(radius, away + bodies[child, RADIUS])
                at_most = away + tree.balls[child, SPREAD]
                spread_out += bodies[child, MASS] * raised(at_most * at_most)
        bodies[cell, X], bodies[cell, Y], bodies[cell, Z] = x, y, z
        bodies[cell, RADIUS], bodies[cell, MASS] = radius, mass
        ball = tree.balls[cell]
        for axis in range(3):
            ball[axis] = bodies[cell, axis]
            ball[LOW + axis] = bodies[cell, axis] - ball[axis]
        ball[BALL_RADIUS], ball[SPREAD] = cell_unit(radius), 0.0
        if spread_out > 0.0:
            ball[SPREAD] = (spread_out / mass) ** root
        ball[PULL], ball[COUNT], ball[CHILDREN] = mass, end - start, number

    return measure  # type: ignore[no-any-return]


@jit(numba=False)
def _approach(tree: Tree, cell: Any, relative: bool) -> None:
    """Write a leaf's particles as the pairs see them."""
    start, end = tree.cells[cell, START], tree.cells[cell, END]
    rows = tree.near[4 * start : 4 * end].reshape((4, end - start))
    for axis in range(3):
        old, new = tree.place[axis, start:end], rows[axis]
        center = tree.bodies[cell, axis] if relative else 0.0
        for i in range(old.size):
            new[i] = old[i] - center
    old, new = tree.place[3, start:end], rows[3]
    for i in range(old.size):
        new[i] = old[i]


@cache
def _summation(order: int, harmonic: bool, real: type) -> Callable[..., None]:
    """Compiled function that fills in bodies, near and moments of some branches.

    (tree, branches, relative, ascending, first, last) -> None: `branches` (k, 2) from `first` to
    `last`, each a cell and the row after the last of its descendants.
    """
    operations, lanes = translations(order, harmonic, real), width(real)
    particles_to_moments = operations.particles_to_moments
    sums_to_moments = operations.sums_to_moments
    moments_to_moments = operations.moments_to_moments
    every, basis = operations.every, operations.basis
    measure = _measurer(order)

    @jit(flags=EXACT, numba=False)
    def moments_of_leaf(
        tree: Tree, cell: Any, relative: bool, place: Any, ascending: Any, sums: Any
    ) -> None:
        start, end = tree.cells[cell, START], tree.cells[cell, END]
        body, near, kind = tree.bodies[cell], tree.near, tree.near.dtype.type
        scale, zero = kind(1.0 / cell_unit(body[RADIUS])), kind(0)
        sums[:] = 0
        count = end - start
        for first in range(0, count, lanes):
            inside = take(ascending, 0, lanes) < np.int32(count - first)
            row = 4 * start + first
            for axis in range(3):
                center = kind(0.0 if relative else body[axis])
                given = choose(inside, take(near, row + axis * count, lanes), center)
                write(place[axis], 0, (center - given) * scale)
            write(place[3], 0, choose(inside, take(near, row + 3 * count, lanes), zero))
            particles_to_moments(place, sums)
        sums_to_moments(sums, tree.moments[cell])

    @jit(flags=EXACT, numba=False)
    def moments_of_parent(tree: Tree, cell: Any, place: Any, chosen: Any) -> None:
        bodies = tree.bodies
        first, number = tree.cells[cell, FIRST], tree.cells[cell, NUMBER]
        body = bodies[cell]
        scale = 1.0 / cell_unit(body[RADIUS])
        for lane in range(FAMILY):
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
        tree: Tree, branches: Any, relative: bool, ascending: Any, first: Any, last: Any
    ) -> None:
        kind = tree.near.dtype.type
        place, sums = np.empty((5, lanes), kind), np.empty((every, lanes), kind)
        children, chosen = np.empty((5, FAMILY), kind), np.zeros(FAMILY, np.int32)
        place[:] = 1
        children[:] = 1
        for branch in range(first, last):
            top, end = branches[branch, 0], branches[branch, 1]
            under = end - tree.cells[top, FIRST]
            for k in range(under + 1):
                cell = end - 1 - k if k < under else top
                is_leaf = tree.cells[cell, NUMBER] == 0
                measure(tree, cell)
                if is_leaf:
                    _approach(tree, cell, relative)
                if tree.moments.shape[0] > 0:
                    if is_leaf:
                        moments_of_leaf(tree, cell, relative, place, ascending, sums)
                    else:
                        moments_of_parent(tree, cell, children, chosen)
                    # Single precision would lose digits of the sum of many equal masses.
                    tree.moments[cell, 0] = tree.bodies[cell, MASS]
                    if tree.rounded.shape[0] > 0:
                        for k in range(basis):
                            tree.rounded[cell, k] = tree.moments[cell, k]

    return fill  # type: ignore[no-any-return]


def summarize(
    tree: Tree, order: int, harmonic: bool, real: type, sources: bool, room: Room | None = None,
    mixed: bool = False,
) -> Tree:  # fmt: skip
    """The tree with bodies, and for `sources` moments, filled in from places and masses.

    `mixed`: with moments in single precision as well.
    """
    room = room or Room()
    branches, stem = divide_work(tree)
    operations, fill = translations(order, harmonic, real), _summation(order, harmonic, real)
    n, rows = tree.place.shape[1], len(tree.cells) + LANES
    near = room.array("records", (4 * n + LANES,), real)
    near[-LANES:] = 0
    balls = room.array("balls", (rows, BALL), real)
    balls[-LANES:] = NOTHING
    count = len(tree.cells) + 1 if sources else 0
    moments = room.array("moments", (count, padded(operations.basis)), real)
    moments[-1:] = 0  # Of rows that lanes which are left over are about.
    rounded = room.array("rounded", moments.shape if mixed else (0, 0), np.float32)
    rounded[-1:] = 0
    tree = tree._replace(near=near, balls=balls, moments=moments, rounded=rounded)
    relative, ascending = real is np.float32, np.arange(LANES, dtype=np.int32)
    tasks = min(max(n // PARTICLES_OF_A_TASK, 1), TASKS)
    cuts = np.searchsorted(tree.cells[branches[:, 0], START], np.arange(tasks + 1) * n / tasks)
    parts = [(int(a), int(b)) for a, b in pairwise(cuts) if a < b]
    each(fill, (tree, branches, relative, ascending), parts)
    # The cells above have nothing under them that is not filled in.
    alone = np.stack([stem, tree.cells[stem, FIRST]], axis=1)[::-1].copy()
    fill(tree, alone, relative, ascending, 0, len(alone))
    return tree


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
