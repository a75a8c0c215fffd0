"""Sums over packed sources; those that rounding might spoil are formed again, in double precision.

In single precision, coordinates are taken from the center of the target leaf. Two particles that
are much closer to each other than to that center know their distance badly. Where pairs are `fine`,
coordinates are in two parts and their differences are good, but each pair's pull is wrong by some
1e-7 of itself: what one close neighbour adds to that is seen, too.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import Desk, Limits
from motes.interact.gravity.lanes import LANES, read, spread, write
from motes.interact.gravity.pairs import attraction
from motes.interact.gravity.softening import center_depth, pair_law
from motes.interact.gravity.tree import END, RADIUS, START, Tree
from motes.jit import EXACT, jit
from motes.machine.lanes import choose, total

ROUNDING = 6e-8
"""Change of a difference of coordinates by single precision, in units of the largest of them."""

OF_A_PULL = 1e-7
"""Error of one pull in single precision, in parts of it, where coordinates are exact."""


@cache
def packed_sum(law: str, real: type, mixed: bool, potential: bool) -> Callable[..., Any]:
    """Compiled function that adds to `desk.total` the pull of `desk.source` on a target leaf.

    (targets, sources, cell, packed, spans, distance, heaviest, own, limits, desk) -> None: `packed`
    sources with coordinates of at most `distance` and masses of at most `heaviest`, the particles
    in the first `spans` rows of `desk.spans`; `own` as in `attraction`.
    """
    single = real is np.float32
    pairs: Any = np.float32 if mixed else real
    attract = attraction(law, pairs, potential, bound=single or mixed, fine=mixed)
    attract_roughly = attraction(law, pairs, potential, bound=single, rough=single)
    exact, depth = pair_law(law, np.float64), center_depth(law, 1.0)
    cube_of_pull, nothing = OF_A_PULL**3, pairs(0)

    @jit(flags=EXACT, numba=False)
    def sum_exactly(
        sources: Tree, spans: Any, count: Any, place: Any, size: Any, ascending: Any, part: Any
    ) -> None:
        x, y, z = place[0], place[1], place[2]
        xs, ys, zs, ms = sources.place[0], sources.place[1], sources.place[2], sources.place[3]
        sizes = size, 1.0 / size if size > 0.0 else 0.0
        ax = ay = az = value = 0.0
        for k in range(count):
            last = spans[k, 1]
            for i in range(spans[k, 0], last, LANES):
                dx, dy, dz = read(xs, i) - x, read(ys, i) - y, read(zs, i) - z
                s, w = exact(dx * dx + dy * dy + dz * dz, sizes)
                # The last lanes may hold more than this leaf.
                m = choose(ascending < np.int32(last - i), read(ms, i), 0.0)
                s = s * m
                ax, ay, az, value = ax + s * dx, ay + s * dy, az + s * dz, value + w * m
        part[0], part[1], part[2], part[4] = total(ax), total(ay), total(az), total(value)

    @jit(inline=True, flags=EXACT)
    def is_spoiled(part: Any, blur: Any, heaviest: Any, limit: Any) -> Any:
        """Whether sums (5,) over sources, the largest m s among them, may be wrong by the limit."""
        x, most = part[0], np.float64(part[3])
        if mixed:
            # s <= 1 / r^3, so that no pull is larger than (m (m s)^2)^(1/3).
            is_good = cube_of_pull * heaviest * most * most <= limit * limit * limit
        else:
            is_good = blur * most <= limit
        return not is_good or x != x or most - most != 0.0

    @jit(flags=EXACT, numba=False)
    def sum_packed(
        targets: Tree, sources: Tree, cell: Any, packed: Any, spans: Any, distance: Any,
        heaviest: Any, own: Any, limits: Limits, desk: Desk,
    ) -> None:  # fmt: skip
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        part, source = desk.part, desk.source
        # Massless sources where no target is make the number a multiple of the lanes.
        for axis in range(3):
            write(source[axis], packed, spread(pairs(4.0 * distance)))
            if mixed:
                write(source[4 + axis], packed, spread(nothing))
        write(source[3], packed, spread(nothing))
        packed = (packed + LANES - 1) // LANES * LANES
        part[:] = 0
        size = pairs(limits.size)
        if single and limits.rough:
            attract_roughly(desk.target, count, source, packed, own, size, part)
        else:
            attract(desk.target, count, source, packed, own, size, part)
        if single or mixed:
            # Twice the change of s dx by coordinates that are wrong by a little.
            blur = 2.0 * ROUNDING * (distance + targets.bodies[cell, RADIUS])
            for i in range(count):
                if potential and own[0] <= i < own[1] and depth > 0.0:
                    part[4, i] += targets.near[4 * start + 3 * count + i] * (depth / limits.size)
                if is_spoiled(part[:, i], blur, heaviest, limits.rounding):
                    place, ascending = targets.place[:, start + i], read(desk.ascending, 0)
                    sum_exactly(
                        sources, desk.spans, spans, place, limits.size, ascending, part[:, i]
                    )
        for row in range(5):
            if row != 3:
                for i in range(0, count, LANES):
                    write(desk.total[row], i, read(desk.total[row], i) + read(part[row], i))

    return sum_packed  # type: ignore[no-any-return]
