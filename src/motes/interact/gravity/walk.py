"""The walk: each target cell gathers from source cells, by expansions if it may, else by pairs.

A task owns a range of target particles. It goes down from the root to them; each cell inherits from
its parent the source cells that were too near for it and the local expansion of all others, so that
nothing is written that another task reads, and the cost is O(n). Source: the dual tree walk of
Dehnen, Journal of Computational Physics 179 (2002) 27, with lists owned by the target.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.interact.gravity.desk import Desk, Limits
from motes.interact.gravity.expansions import Tables
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.near import near_field
from motes.interact.gravity.translations import (
    local_to_local,
    local_to_particles,
    moments_to_local,
    unfold,
)
from motes.interact.gravity.tree import END, MASS, RADIUS, SKIP, START, Tree, X, Y, Z, cell_unit
from motes.jit import jit


@jit(inline=True)
def _accepts(limits: Limits, allowed: Any, r2: Any, radii: Any, mass: Any, order: Any) -> Any:
    """Whether an expansion may stand for a source cell of `mass` at R^2, with r_A + r_B `radii`.

    The error of the acceleration must be at most `allowed`; it is about M / R^2 q^p / (1 - q^2)^2,
    q = (r_A + r_B) / R, the sum of the terms that are left out.
    """
    gap = radii + limits.reach
    if limits.reach > 0.0 and gap * gap >= r2:
        return False
    r2 += limits.e2
    ratio2 = radii * radii / r2
    if not ratio2 < limits.opening2:
        return False
    estimate = mass
    for _ in range(order // 2):
        estimate *= ratio2
    if order % 2 == 1:
        estimate *= np.sqrt(ratio2)
    rest = 1.0 - ratio2
    return estimate <= allowed * r2 * (rest * rest)


@jit
def _gather(
    targets: Tree, sources: Tree, cell: Any, low: Any, high: Any, table: Tables, limits: Limits,
    desk: Desk,
) -> Any:  # fmt: skip
    """Add the local terms of all source cells that are far enough; return the end of the others.

    Candidates are those from `low` to `high`; the rest is written from `high` on. Returns -1 if
    there is no room.
    """
    bench, opened, candidates = desk.bench, desk.opened, desk.candidates
    place, ratio, gathered = bench.place, bench.ratio, desk.gathered
    old_moments, new_moments = sources.moments, bench.moments
    cells, bodies = sources.cells, sources.bodies
    order, kind = bench.powers.shape[0] - 1, place.dtype.type
    x, y, z = targets.bodies[cell, X], targets.bodies[cell, Y], targets.bodies[cell, Z]
    radius = targets.bodies[cell, RADIUS]
    count = targets.cells[cell, END] - targets.cells[cell, START]
    is_leaf = targets.cells[cell, SKIP] == cell + 1
    h, e2 = kind(cell_unit(radius)), kind(limits.e2)
    allowed = min(limits.error, limits.force / max(targets.bodies[cell, MASS], 1e-300))
    gathered[:] = 0
    top, lane = high, 0
    for k in range(low, high):
        opened[0] = candidates[k]
        depth = 1
        while depth > 0:
            depth -= 1
            other = opened[depth]
            skip, reach = cells[other, SKIP], bodies[other, RADIUS]
            dx, dy, dz = x - bodies[other, X], y - bodies[other, Y], z - bodies[other, Z]
            leaves = is_leaf and skip == other + 1
            r2 = dx * dx + dy * dy + dz * dz
            far = _accepts(limits, allowed, r2, radius + reach, bodies[other, MASS], order)
            if far and leaves:
                number = cells[other, END] - cells[other, START]
                far = number * count > limits.few
            if far:
                place[0, lane] = kind(dx)
                place[1, lane] = kind(dy)
                place[2, lane] = kind(dz)
                place[3, lane] = kind(1)
                ratio[lane] = kind(cell_unit(reach))
                for row in range(old_moments.shape[1]):
                    new_moments[row, lane] = old_moments[other, row]
                lane += 1
                if lane == LANES:
                    moments_to_local(table, bench, h, e2, gathered)
                    lane = 0
            elif skip > other + 1 and (is_leaf or reach >= radius):
                child = other + 1
                while child < skip:
                    opened[depth] = child
                    depth += 1
                    child = cells[child, SKIP]
            else:
                if top == candidates.size:
                    return -1
                candidates[top] = other
                top += 1
    if lane > 0:
        for unused in range(lane, LANES):
            place[0, unused] = ratio[unused] = kind(1)
            place[1, unused] = place[2, unused] = place[3, unused] = kind(0)
        moments_to_local(table, bench, h, e2, gathered)
    return top


@jit
def _wait(
    targets: Tree, cell: Any, begin: Any, end: Any, low: Any, high: Any, depth: Any, table: Tables,
    desk: Desk,
) -> Any:  # fmt: skip
    """Put a cell's children that own targets from `begin` to `end` on the stack."""
    bench, cells, bodies = desk.bench, targets.cells, targets.bodies
    h = cell_unit(bodies[cell, RADIUS])
    bench.place[:] = 0
    bench.place[3, :] = 1
    lane, child = 0, cell + 1
    while child < cells[cell, SKIP]:
        if cells[child, START] < end and cells[child, END] > begin:
            bench.place[0, lane] = (bodies[child, X] - bodies[cell, X]) / h
            bench.place[1, lane] = (bodies[child, Y] - bodies[cell, Y]) / h
            bench.place[2, lane] = (bodies[child, Z] - bodies[cell, Z]) / h
            bench.ratio[lane] = cell_unit(bodies[child, RADIUS]) / h
            waiting = desk.waiting[depth + lane]
            waiting[0], waiting[1], waiting[2] = child, low, high
            lane += 1
        child = cells[child, SKIP]
    local_to_local(table, bench, desk.local[depth : depth + lane])
    return depth + lane


@cache
def walker(law: str, real: type, potential: bool) -> Callable[..., Any]:
    """Compiled walk for a pair law, numbers of type `real`, with or without the potential.

    (targets, sources, same, begin, end, table, limits, desk, out) -> int: writes to rows 0 to 2 of
    `out` (4, n) the sums of m s dx, and with `potential` to row 3 those of m w, for particles
    `begin` to `end` of `targets`, which are whole cells. Returns 0, or 1 if the lists of candidates
    need more room. `same`: the two trees are one, and a particle is among its own sources.
    """
    sum_near = near_field(law, real, potential)

    @jit
    def walk(
        targets: Tree, sources: Tree, same: Any, begin: Any, end: Any, table: Tables,
        limits: Limits, desk: Desk, out: Any,
    ) -> Any:  # fmt: skip
        total, kind = desk.total, desk.total.dtype.type
        desk.local[0] = 0
        desk.candidates[0] = 0
        waiting = desk.waiting
        waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, 0, 1
        depth = 1
        while depth > 0:
            depth -= 1
            cell, low, high = waiting[depth]
            top = _gather(targets, sources, cell, low, high, table, limits, desk)
            if top < 0:
                return 1
            for row in range(table.kept.size):
                desk.local[depth, row] += desk.gathered[row].sum()
            unfold(table, desk.local[depth], desk.bench.whole)
            if targets.cells[cell, SKIP] > cell + 1:
                depth = _wait(targets, cell, begin, end, high, top, depth, table, desk)
                continue
            start = targets.cells[cell, START]
            count = targets.cells[cell, END] - start
            body = targets.bodies[cell]
            total[:] = 0
            for i in range(count):
                desk.part[0, i] = targets.place[0, start + i] - body[X]
                desk.part[1, i] = targets.place[1, start + i] - body[Y]
                desk.part[2, i] = targets.place[2, start + i] - body[Z]
            scale = kind(1.0 / cell_unit(body[RADIUS]))
            local_to_particles(table, desk.bench, desk.part, count, scale, potential, total)
            sum_near(targets, sources, same, cell, desk.candidates[high:top], limits, desk)
            for i in range(count):
                out[0, start + i] = total[0, i]
                out[1, start + i] = total[1, i]
                out[2, start + i] = total[2, i]
                if potential:
                    out[3, start + i] = total[4, i]
        return 0

    return walk  # type: ignore[no-any-return]
