"""The near field: a leaf's particles and those of the source leaves around it, pair by pair."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import SOURCES, Desk, Limits
from motes.interact.gravity.lanes import LANES, maximum, read, spread, write
from motes.interact.gravity.packed import packed_sum
from motes.interact.gravity.softening import center_depth
from motes.interact.gravity.tree import END, MASS, RADIUS, START, Tree, X, Y, Z
from motes.jit import EXACT, jit
from motes.machine.lanes import fetch, largest
from motes.memory import LINE

WIDER = 16.0
"""How many times farther leaves reach that are summed apart from the nearest."""


@jit(inline=True)
def reach_of(body: Any, x: Any, y: Any, z: Any) -> Any:
    """Largest coordinate of a cell's particles from a place: what rounding is in proportion to."""
    return max(abs(body[X] - x), abs(body[Y] - y), abs(body[Z] - z)) + body[RADIUS]


@jit(inline=True, flags=EXACT)
def write_parts(rows: Any, first: Any, coarse: Any, fine: Any, lanes: Any) -> None:
    """Write lanes to two rows, rounded to single precision and what they lack then."""
    rounded = np.float32(lanes)
    write(rows[coarse], first, rounded)
    write(rows[fine], first, np.float32(lanes - np.float64(rounded)))


@cache
def near_field(law: str, real: type, mixed: bool, potential: bool) -> Callable[..., Any]:
    """Compiled function that adds to `desk.total` the pull of source leaves on a target leaf.

    (targets, sources, same, cell, low, high, limits, desk) -> None: the leaves are candidates `low`
    to `high`; `same`: the trees are one.
    """
    single, of_a_line = real is np.float32, LINE // np.dtype(real).itemsize
    pairs: Any = np.float32 if mixed else real
    most_sources = SOURCES[mixed]
    sum_packed = packed_sum(law, real, mixed, potential)
    depth = center_depth(law, 1.0)
    nothing = pairs(0)

    @jit(flags=EXACT, numba=False)
    def lay_out(targets: Tree, cell: Any, desk: Desk) -> None:
        """Write the targets as the pair law sees them."""
        start, target = targets.cells[cell, START], desk.target
        count = targets.cells[cell, END] - start
        for axis in range(3):
            for i in range(0, count, LANES):
                place = read(targets.near, 4 * start + axis * count + i)
                if mixed:
                    write_parts(target, i, axis, 3 + axis, place - targets.bodies[cell, axis])
                else:
                    write(target[axis], i, place)

    @jit(flags=EXACT, numba=False)
    def pack(
        near: Any, place: Any, many: Any, taken: Any, center: Any, shift: Any, packed: Any,
        desk: Desk,
    ) -> Any:  # fmt: skip
        """Write `taken` particles of a leaf of `many` to `desk.source`; return the largest mass."""
        source = desk.source
        heaviest = spread(nothing)
        # The last lanes may hold more than this leaf; what follows overwrites them.
        for i in range(0, taken, LANES):
            old, new = place + i, packed + i
            m = pairs(read(near, old + 3 * many))
            if mixed:
                heaviest = maximum(m, heaviest)
                for axis in range(3):
                    write_parts(
                        source, new, axis, 4 + axis, read(near, old + axis * many) - center[axis]
                    )
            else:
                for axis in range(3):
                    write(source[axis], new, read(near, old + axis * many) + shift[axis])
            write(source[3], new, m)
        return largest(heaviest)

    @jit(flags=EXACT, numba=False)
    def sum_near(
        targets: Tree, sources: Tree, same: Any, cell: Any, low: Any, high: Any, limits: Limits,
        desk: Desk,
    ) -> None:  # fmt: skip
        cells, bodies, near, spans = sources.cells, sources.bodies, sources.near, desk.spans
        body = targets.bodies[cell]
        x, y, z, radius = body[X], body[Y], body[Z], body[RADIUS]
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        lay_out(targets, cell, desk)
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
            distance, heaviest, own = radius, nothing, (0, 0, 0)
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
                shift = nothing, nothing, nothing
                if single:
                    shift = (
                        pairs(bodies[leaf, X] - x), pairs(bodies[leaf, Y] - y),
                        pairs(bodies[leaf, Z] - z),
                    )  # fmt: skip
                while first < last:
                    taken = min(last - first, most_sources - packed)
                    distance = max(distance, reach)
                    if itself:
                        own = (first - start, first - start + taken, packed - (first - start))
                    heavy = pack(near, place, many, taken, (x, y, z), shift, packed, desk)
                    heaviest = max(heaviest, heavy)
                    spans[pieces, 0], spans[pieces, 1] = first, first + taken
                    pieces, packed = pieces + 1, packed + taken
                    first, place = first + taken, place + taken
                    if packed == most_sources:
                        sum_packed(
                            targets, sources, cell, packed, pieces, distance, heaviest, own,
                            limits, desk,
                        )  # fmt: skip
                        packed = pieces = 0
                        distance, heaviest, own = radius, nothing, (0, 0, 0)
            if packed > 0:
                sum_packed(
                    targets, sources, cell, packed, pieces, distance, heaviest, own, limits, desk
                )
            if not left:
                break

    return sum_near  # type: ignore[no-any-return]
