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

from motes.interact.gravity.desk import Desk, Limits
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.near import near_field
from motes.interact.gravity.translations import translations
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
    if not radii * radii < limits.opening2 * r2:
        return False
    # Squared and multiplied by R^(2p): a division or a root would take as long as all else.
    square, rest = radii * radii, r2 - radii * radii
    estimate, bound = mass * mass, allowed * allowed * r2
    for _ in range(order):
        estimate *= square
    for _ in range(order - 3):
        bound *= r2
    bound *= rest * rest
    if order < 3:
        estimate *= r2
    return estimate <= bound * (rest * rest)


@cache
def walker(law: str, real: type, potential: bool, order: int) -> Callable[..., Any]:
    """Compiled walk for a pair law, numbers of type `real`, with or without the potential.

    (targets, sources, same, begin, end, limits, desk, out) -> int: writes to rows 0 to 2 of
    `out` (4, n) the sums of m s dx, and with `potential` to row 3 those of m w, for particles
    `begin` to `end` of `targets`, which are whole cells. Returns 0, or 1 if the lists of candidates
    need more room. `same`: the two trees are one, and a particle is among its own sources.
    """
    sum_near = near_field(law, real, potential)
    operations = translations(order, law != "plummer")
    moments_to_local, local_to_local = operations.moments_to_local, operations.local_to_local
    lanes_to_local, local_to_particles = operations.lanes_to_local, operations.local_to_particles
    zero, one = real(0), real(1)

    @jit
    def gather(
        targets: Tree, sources: Tree, cell: Any, low: Any, high: Any, limits: Limits, desk: Desk
    ) -> Any:
        """Add the local terms of all source cells that are far enough; return the others' end.

        Candidates are those from `low` to `high`; the rest is written from `high` on. Returns -1 if
        there is no room.
        """
        opened, candidates, place, chosen = desk.opened, desk.candidates, desk.place, desk.chosen
        cells, bodies = sources.cells, sources.bodies
        x, y, z = targets.bodies[cell, X], targets.bodies[cell, Y], targets.bodies[cell, Z]
        radius = targets.bodies[cell, RADIUS]
        count = targets.cells[cell, END] - targets.cells[cell, START]
        is_leaf = targets.cells[cell, SKIP] == cell + 1
        h, e2 = real(cell_unit(radius)), real(limits.e2)
        allowed = min(limits.error, limits.force / max(targets.bodies[cell, MASS], 1e-300))
        desk.gathered[:] = 0
        place[3, :] = 1
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
                    place[0, lane], place[1, lane], place[2, lane] = real(dx), real(dy), real(dz)
                    place[4, lane] = real(cell_unit(reach))
                    chosen[lane] = other
                    lane += 1
                    if lane == LANES:
                        moments_to_local(place, chosen, sources.moments, h, e2, desk.gathered)
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
                place[0, unused] = place[4, unused] = one
                place[1, unused] = place[2, unused] = place[3, unused] = zero
                chosen[unused] = 0
            moments_to_local(place, chosen, sources.moments, h, e2, desk.gathered)
        return top

    @jit
    def wait(
        targets: Tree, cell: Any, begin: Any, end: Any, low: Any, high: Any, depth: Any, desk: Desk
    ) -> Any:
        """Put a cell's children that own targets from `begin` to `end` on the stack."""
        place, cells, bodies = desk.place, targets.cells, targets.bodies
        scale = 1.0 / cell_unit(bodies[cell, RADIUS])
        lane, child = 0, cell + 1
        while child < cells[cell, SKIP]:
            if cells[child, START] < end and cells[child, END] > begin:
                place[0, lane] = real((bodies[child, X] - bodies[cell, X]) * scale)
                place[1, lane] = real((bodies[child, Y] - bodies[cell, Y]) * scale)
                place[2, lane] = real((bodies[child, Z] - bodies[cell, Z]) * scale)
                place[4, lane] = real(cell_unit(bodies[child, RADIUS]) * scale)
                waiting = desk.waiting[depth + lane]
                waiting[0], waiting[1], waiting[2] = child, low, high
                lane += 1
            child = cells[child, SKIP]
        # What unused lanes write lies above the stack; the cell's own terms are read before.
        local_to_local(place, desk.local[depth], desk.local, depth)
        return depth + lane

    @jit
    def finish(targets: Tree, cell: Any, terms: Any, desk: Desk) -> None:
        """Begin the sums of a leaf with the field of its local terms."""
        place, out, body = desk.place, desk.gathered, targets.bodies[cell]
        start, end = targets.cells[cell, START], targets.cells[cell, END]
        scale = 1.0 / cell_unit(body[RADIUS])
        for first in range(0, end - start, LANES):
            for lane in range(LANES):
                i = min(start + first + lane, end - 1)
                place[0, lane] = real((targets.place[0, i] - body[X]) * scale)
                place[1, lane] = real((targets.place[1, i] - body[Y]) * scale)
                place[2, lane] = real((targets.place[2, i] - body[Z]) * scale)
            local_to_particles(place, terms, real(scale), out)
            for lane in range(LANES):
                for axis in range(3):
                    desk.total[axis, first + lane] = out[axis, lane]
                desk.total[4, first + lane] = out[3, lane]

    @jit
    def walk(
        targets: Tree, sources: Tree, same: Any, begin: Any, end: Any, limits: Limits, desk: Desk,
        out: Any,
    ) -> Any:  # fmt: skip
        total, waiting = desk.total, desk.waiting
        desk.local[0] = 0
        desk.candidates[0] = 0
        waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, 0, 1
        depth = 1
        while depth > 0:
            depth -= 1
            cell, low, high = waiting[depth]
            top = gather(targets, sources, cell, low, high, limits, desk)
            if top < 0:
                return 1
            lanes_to_local(desk.gathered, desk.local[depth])
            if targets.cells[cell, SKIP] > cell + 1:
                depth = wait(targets, cell, begin, end, high, top, depth, desk)
                continue
            finish(targets, cell, desk.local[depth], desk)
            sum_near(targets, sources, same, cell, desk.candidates[high:top], limits, desk)
            start = targets.cells[cell, START]
            for i in range(targets.cells[cell, END] - start):
                out[0, start + i] = total[0, i]
                out[1, start + i] = total[1, i]
                out[2, start + i] = total[2, i]
                if potential:
                    out[3, start + i] = total[4, i]
        return 0

    return walk  # type: ignore[no-any-return]
