"""The near field: a leaf's particles and those of the source leaves around it, pair by pair."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import SOURCES, Desk, Limits
from motes.interact.gravity.lanes import LANES, read, spread, write
from motes.interact.gravity.pairs import attraction
from motes.interact.gravity.softening import center_depth, pair_law
from motes.interact.gravity.tree import END, MASS, RADIUS, START, Tree, X, Y, Z
from motes.jit import EXACT, jit
from motes.machine.lanes import fetch, total
from motes.memory import LINE

ROUNDING = 6e-8
"""Change of a difference of coordinates by single precision, in units of the largest of them."""


WIDER = 16.0
"""How many times farther leaves reach that are summed apart from the nearest."""


@jit(inline=True)
def reach_of(body: Any, x: Any, y: Any, z: Any) -> Any:
    """Largest coordinate of a cell's particles from a place: what rounding is in proportion to."""
    return max(abs(body[X] - x), abs(body[Y] - y), abs(body[Z] - z)) + body[RADIUS]


@cache
def near_field(law: str, real: type, potential: bool) -> Callable[..., Any]:
    """Compiled function that adds to `desk.total` the pull of source leaves on a target leaf.

    (targets, sources, same, cell, low, high, limits, desk) -> None: the leaves are candidates `low`
    to `high`; `same`: the trees are one.

    In single precision, coordinates are taken from the leaf's center, and a target for which their
    rounding might matter, because a source is very close, is summed again in double precision.
    """
    single, of_a_line = real is np.float32, LINE // np.dtype(real).itemsize
    attract = attraction(law, real, potential, bound=single)
    attract_roughly = attraction(law, real, potential, bound=single, rough=single)
    exact = pair_law(law, np.float64)
    depth = center_depth(law, 1.0)
    nothing = real(0)

    @jit(flags=EXACT, numba=False)
    def sum_exactly(
        sources: Tree, spans: Any, count: Any, place: Any, size: Any, some: Any, part: Any
    ) -> None:
        x, y, z = place[0], place[1], place[2]
        sizes = size, 1.0 / size if size > 0.0 else 0.0
        ax = ay = az = value = 0.0
        for k in range(count):
            for first in range(spans[k, 0], spans[k, 1], LANES):
                some[3] = 0.0
                for lane in range(min(LANES, spans[k, 1] - first)):
                    for row in range(4):
                        some[row, lane] = sources.place[row, first + lane]
                dx, dy, dz = read(some[0], 0) - x, read(some[1], 0) - y, read(some[2], 0) - z
                s, w = exact(dx * dx + dy * dy + dz * dz, sizes)
                m = read(some[3], 0)
                s = s * m
                ax, ay, az, value = ax + s * dx, ay + s * dy, az + s * dz, value + w * m
        part[0], part[1], part[2], part[4] = total(ax), total(ay), total(az), total(value)

    @jit(flags=EXACT, numba=False)
    def sum_packed(
        targets: Tree, sources: Tree, cell: Any, packed: Any, spans: Any, distance: Any, own: Any,
        limits: Limits, desk: Desk,
    ) -> None:  # fmt: skip
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        part, source = desk.part, desk.source
        # Massless sources where no target is make the number a multiple of the lanes.
        for axis in range(3):
            write(source[axis], packed, spread(real(4.0 * distance)))
        write(source[3], packed, spread(nothing))
        packed = (packed + LANES - 1) // LANES * LANES
        part[:] = 0
        size = real(limits.size)
        if single and limits.rough:
            attract_roughly(desk.target, count, source, packed, own, size, part)
        else:
            attract(desk.target, count, source, packed, own, size, part)
        if single:
            # Twice the change of s dx by coordinates that are wrong by a little.
            blur = 2.0 * ROUNDING * (distance + targets.bodies[cell, RADIUS])
            for i in range(count):
                if potential and own[0] <= i < own[1] and depth > 0.0:
                    part[4, i] += targets.near[4 * start + 3 * count + i] * (depth / limits.size)
                x = part[0, i]
                if not blur * part[3, i] <= limits.rounding or x != x:
                    place = targets.place[:, start + i]
                    sum_exactly(
                        sources, desk.spans, spans, place, limits.size, desk.exact, part[:, i]
                    )
        for row in range(5):
            if row != 3:
                for i in range(0, count, LANES):
                    write(desk.total[row], i, read(desk.total[row], i) + read(part[row], i))

    @jit(flags=EXACT, numba=False)
    def sum_near(
        targets: Tree, sources: Tree, same: Any, cell: Any, low: Any, high: Any, limits: Limits,
        desk: Desk,
    ) -> None:  # fmt: skip
        cells, bodies = sources.cells, sources.bodies
        source, target, spans = desk.source, desk.target, desk.spans
        new_x, new_y, new_z, new_m = source[0], source[1], source[2], source[3]
        near = sources.near
        x, y, z = targets.bodies[cell, X], targets.bodies[cell, Y], targets.bodies[cell, Z]
        radius = targets.bodies[cell, RADIUS]
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        for axis in range(3):
            for i in range(0, count, LANES):
                write(target[axis], i, read(targets.near, 4 * start + axis * count + i))
        # Rounding is in proportion to the largest coordinate of what is summed together, and large
        # leaves around a small one would make it large for all: they are summed apart.
        least, reaches = 1e300, desk.reaches
        for k in range(low, high):
            leaf = desk.candidates[k]
            first, last = cells[leaf, START], cells[leaf, END]
            # They are packed next, when they all have come.
            for row in range(4 * first, 4 * last, of_a_line):
                fetch(near, row)
            fetch(near, 4 * last - 1)
            reach = reach_of(bodies[leaf], x, y, z)
            reaches[k - low] = reach
            if not (same and leaf == cell):
                least = min(least, reach)
        border = WIDER * max(radius, least) if single else 1e300
        for wide in range(2):
            packed = pieces = 0
            distance, own = radius, (0, 0, 0)
            left = False
            for k in range(low, high):
                leaf, reach = desk.candidates[k], reaches[k - low]
                if (reach > border) != (wide == 1):
                    left = True
                    continue
                first, last = cells[leaf, START], cells[leaf, END]
                many, place = last - first, 4 * first
                itself = same and leaf == cell
                if itself and radius == 0.0:
                    if potential and depth > 0.0:
                        for i in range(count):
                            desk.total[4, i] += bodies[leaf, MASS] * (depth / limits.size)
                    continue
                sx, sy, sz = nothing, nothing, nothing
                if single:
                    sx, sy, sz = (
                        real(bodies[leaf, X] - x), real(bodies[leaf, Y] - y),
                        real(bodies[leaf, Z] - z),
                    )  # fmt: skip
                while first < last:
                    taken = min(last - first, SOURCES - packed)
                    distance = max(distance, reach)
                    if itself:
                        own = (first - start, first - start + taken, packed - (first - start))
                    # The last lanes may hold more than this leaf; what follows overwrites them.
                    for i in range(0, taken, LANES):
                        old = place + i
                        write(new_x, packed + i, read(near, old) + sx)
                        write(new_y, packed + i, read(near, old + many) + sy)
                        write(new_z, packed + i, read(near, old + 2 * many) + sz)
                        write(new_m, packed + i, read(near, old + 3 * many))
                    spans[pieces, 0], spans[pieces, 1] = first, first + taken
                    pieces, packed = pieces + 1, packed + taken
                    first, place = first + taken, place + taken
                    if packed == SOURCES:
                        sum_packed(
                            targets, sources, cell, packed, pieces, distance, own, limits, desk
                        )
                        packed = pieces = 0
                        distance, own = radius, (0, 0, 0)
            if packed > 0:
                sum_packed(targets, sources, cell, packed, pieces, distance, own, limits, desk)
            if not left:
                break

    return sum_near  # type: ignore[no-any-return]
