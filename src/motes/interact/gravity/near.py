"""The near field: a leaf's particles and those of the source leaves around it, pair by pair."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import SOURCES, Desk, Limits
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.pairs import attraction
from motes.interact.gravity.softening import center_depth, pair_law
from motes.interact.gravity.tree import END, MASS, RADIUS, START, Tree, X, Y, Z
from motes.jit import jit

ROUNDING = 1e-7
"""Change of a difference of coordinates by single precision, in units of the largest of them."""


@cache
def near_field(law: str, real: type, potential: bool) -> Callable[..., Any]:
    """Compiled function that adds to `desk.total` the pull of source leaves on a target leaf.

    (targets, sources, same, cell, leaves, limits, desk) -> None; `same`: the trees are one.

    In single precision, coordinates are taken from the leaf's center, and a target for which their
    rounding might matter, because a source is very close, is summed again in double precision.
    """
    single = real is np.float32
    attract = attraction(law, real, potential, bound=single)
    exact = pair_law(law, np.float64)
    depth = center_depth(law, 1.0)

    @jit
    def sum_exactly(
        sources: Tree, spans: Any, count: Any, place: Any, size: Any, part: Any
    ) -> None:
        ax = ay = az = value = 0.0
        for k in range(count):
            xs = sources.place[0, spans[k, 0] : spans[k, 1]]
            ys = sources.place[1, spans[k, 0] : spans[k, 1]]
            zs = sources.place[2, spans[k, 0] : spans[k, 1]]
            ms = sources.place[3, spans[k, 0] : spans[k, 1]]
            for j in range(xs.size):
                dx, dy, dz = xs[j] - place[0], ys[j] - place[1], zs[j] - place[2]
                s, w = exact(dx * dx + dy * dy + dz * dz, size)
                s *= ms[j]
                ax, ay, az, value = ax + s * dx, ay + s * dy, az + s * dz, value + w * ms[j]
        part[0], part[1], part[2] = ax, ay, az
        if potential:
            part[4] = value

    @jit
    def sum_packed(
        targets: Tree, sources: Tree, cell: Any, packed: Any, spans: Any, distance: Any,
        has_itself: Any, limits: Limits, desk: Desk,
    ) -> None:  # fmt: skip
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        part, total, source = desk.part, desk.total, desk.source
        # Massless sources where no target is make the number a multiple of the lanes.
        while packed % LANES > 0:
            source[0, packed] = source[1, packed] = source[2, packed] = 4.0 * distance
            source[3, packed] = source[4, packed] = 0.0
            packed += 1
        part[:] = 0
        alarm = part.dtype.type(2.0 * limits.rounding)
        xs, ys, zs = source[0, :packed], source[1, :packed], source[2, :packed]
        ms, wrongs, size = source[3, :packed], source[4, :packed], part.dtype.type(limits.size)
        attract(desk.target, count, xs, ys, zs, ms, wrongs, size, alarm, part)
        if single:
            # A particle in its own leaf sounds one alarm itself.
            limit = limits.rounding + (alarm if has_itself else 0.0)
            for i in range(count):
                if not part[3, i] <= limit:
                    place = targets.place[:, start + i]
                    sum_exactly(sources, desk.spans, spans, place, limits.size, part[:, i])
        for row in range(5):
            for i in range(count):
                total[row, i] += part[row, i]

    @jit
    def sum_near(
        targets: Tree, sources: Tree, same: Any, cell: Any, leaves: Any, limits: Limits, desk: Desk
    ) -> None:
        cells, bodies, near, old = sources.cells, sources.bodies, targets.near, sources.near
        source, target, spans = desk.source, desk.target, desk.spans
        kind = source.dtype.type
        x, y, z = targets.bodies[cell, X], targets.bodies[cell, Y], targets.bodies[cell, Z]
        radius = targets.bodies[cell, RADIUS]
        start = targets.cells[cell, START]
        count = targets.cells[cell, END] - start
        for axis in range(3):
            for i in range(count):
                target[axis, i] = near[axis, start + i]
        packed = pieces = 0
        distance, has_itself = radius, False
        for k in range(leaves.size):
            leaf = leaves[k]
            first, last = cells[leaf, START], cells[leaf, END]
            itself = same and leaf == cell
            if itself and radius == 0.0:
                if potential:
                    value = kind(bodies[leaf, MASS] * depth / (limits.size if depth > 0.0 else 1.0))
                    desk.total[4, :count] += value
                continue
            dx, dy, dz = bodies[leaf, X] - x, bodies[leaf, Y] - y, bodies[leaf, Z] - z
            reach = np.sqrt(dx * dx + dy * dy + dz * dz) + bodies[leaf, RADIUS]
            shift = (kind(dx), kind(dy), kind(dz)) if single else (kind(0), kind(0), kind(0))
            while first < last:
                taken = min(last - first, SOURCES - packed)
                distance = max(distance, reach)
                has_itself = has_itself or itself
                for axis in range(3):
                    for i in range(taken):
                        source[axis, packed + i] = old[axis, first + i] + shift[axis]
                for i in range(taken):
                    source[3, packed + i] = old[3, first + i]
                if single:
                    wrong = kind(ROUNDING * (reach + radius))
                    for i in range(taken):
                        source[4, packed + i] = old[3, first + i] * wrong
                spans[pieces, 0], spans[pieces, 1] = first, first + taken
                pieces, packed, first = pieces + 1, packed + taken, first + taken
                if packed == SOURCES:
                    sum_packed(
                        targets, sources, cell, packed, pieces, distance, has_itself, limits, desk
                    )
                    packed = pieces = 0
                    distance, has_itself = radius, False
        if packed > 0:
            sum_packed(targets, sources, cell, packed, pieces, distance, has_itself, limits, desk)

    return sum_near  # type: ignore[no-any-return]
