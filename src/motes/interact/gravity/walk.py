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

from motes.interact.gravity.acceptance import acceptance
from motes.interact.gravity.desk import Desk, Limits
from motes.interact.gravity.lanes import LANES, read, spread, write
from motes.interact.gravity.near import near_field
from motes.interact.gravity.translations import translations
from motes.interact.gravity.tree import (
    BALL_RADIUS,
    END,
    FIRST,
    MASS,
    NUMBER,
    RADIUS,
    START,
    Tree,
    X,
    Y,
    Z,
    cell_unit,
)
from motes.jit import jit


@cache
def walker(law: str, real: type, potential: bool, order: int) -> Callable[..., Any]:
    """Compiled walk for a pair law, numbers of type `real`, with or without the potential.

    (targets, sources, same, ranges, limits, desk, out) -> int: writes to rows 0 to 2 of `out`
    (4, n) the sums of m s dx, and with `potential` to row 3 those of m w, for the particles of
    `targets` in `ranges` (k, 2), first and last + 1, which are whole cells. Returns 0, or 1 if the
    lists of candidates need more room. `same`: the two trees are one, and a particle is among its
    own sources.
    """
    sum_near = near_field(law, real, potential)
    operations = translations(order, law != "plummer")
    moments_to_local, local_to_local = operations.moments_to_local, operations.local_to_local
    lanes_to_local, local_to_particles = operations.lanes_to_local, operations.local_to_particles
    is_far = acceptance(order)
    zero = real(0)

    @jit
    def gather(
        targets: Tree, sources: Tree, cell: Any, low: Any, high: Any, limits: Limits, desk: Desk
    ) -> Any:
        """Add the local terms of all source cells that are far enough; return the others' end.

        Candidates are those from `low` to `high`; the rest is written from `high` on. Returns -1 if
        there is no room.
        """
        opened, candidates, chosen, far = desk.opened, desk.candidates, desk.chosen, desk.far
        cells, balls, verdict = sources.cells, sources.balls, desk.verdict
        own = targets.balls[cell]
        radius, e2 = own[BALL_RADIUS], real(limits.e2)
        count = targets.cells[cell, END] - targets.cells[cell, START]
        is_leaf = targets.cells[cell, NUMBER] == 0
        allowed = min(limits.error, limits.force / max(targets.bodies[cell, MASS], 1e-300))
        stricter = real(1.0 / allowed)
        ascending = read(desk.ascending, 0)
        opening2, reach = real(limits.opening2), real(limits.reach)
        desk.gathered[:] = 0
        top, depth, accepted = high, 0, 0
        while True:
            while depth < LANES and low < high:
                opened[depth] = candidates[low]
                low, depth = low + 1, depth + 1
            number = min(depth, LANES)
            depth -= number
            write(chosen, 0, read(opened, depth))
            if number > 0:
                if top + LANES > candidates.size:
                    return -1
                is_far(balls, chosen, own, stricter, opening2, reach, e2, verdict)
            # Each cell is written to every list, and only the end of its own moves on: where a
            # cell belongs cannot be foreseen by a processor, and a wrong guess costs more.
            for lane in range(number):
                other = chosen[lane]
                many, children = cells[other, END] - cells[other, START], cells[other, NUMBER]
                separate = verdict[0, lane] > zero
                if is_leaf:
                    separate = separate & ((children > 0) | (many * count > limits.few))
                divides = (children > 0) & (is_leaf | (balls[other, BALL_RADIUS] >= radius))
                far[accepted] = other
                accepted += separate
                candidates[top] = other
                top += ~separate & ~divides
                write(opened, depth, spread(cells[other, FIRST]) + ascending)
                depth += children * (~separate & divides)
            if accepted >= LANES or (depth == 0 and low == high):
                if accepted == 0:
                    return top
                for lane in range(accepted, LANES):
                    far[lane] = cells.shape[0]
                moments_to_local(balls, far, own, sources.moments, e2, desk.gathered)
                accepted = max(accepted - LANES, 0)
                write(far, 0, read(far, LANES))

    @jit
    def wait(
        targets: Tree, cell: Any, begin: Any, end: Any, low: Any, high: Any, depth: Any, desk: Desk
    ) -> Any:
        """Put a cell's children that own targets from `begin` to `end` on the stack."""
        place, cells, bodies = desk.place, targets.cells, targets.bodies
        scale = 1.0 / cell_unit(bodies[cell, RADIUS])
        lane = 0
        for child in range(cells[cell, FIRST], cells[cell, FIRST] + cells[cell, NUMBER]):
            if cells[child, START] < end and cells[child, END] > begin:
                place[0, lane] = real((bodies[child, X] - bodies[cell, X]) * scale)
                place[1, lane] = real((bodies[child, Y] - bodies[cell, Y]) * scale)
                place[2, lane] = real((bodies[child, Z] - bodies[cell, Z]) * scale)
                place[4, lane] = real(cell_unit(bodies[child, RADIUS]) * scale)
                waiting = desk.waiting[depth + lane]
                waiting[0], waiting[1], waiting[2] = child, low, high
                lane += 1
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
        targets: Tree, sources: Tree, same: Any, ranges: Any, limits: Limits, desk: Desk, out: Any
    ) -> Any:
        total, waiting = desk.total, desk.waiting
        for some in range(ranges.shape[0]):
            begin, end = ranges[some, 0], ranges[some, 1]
            desk.local[0] = 0
            desk.candidates[0] = 0
            waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, 0, 1
            depth = 1
            while depth > 0:
                depth -= 1
                cell, low, high = waiting[depth, 0], waiting[depth, 1], waiting[depth, 2]
                top = gather(targets, sources, cell, low, high, limits, desk)
                if top < 0:
                    return 1
                lanes_to_local(desk.gathered, desk.local[depth])
                if targets.cells[cell, NUMBER] > 0:
                    depth = wait(targets, cell, begin, end, high, top, depth, desk)
                    continue
                finish(targets, cell, desk.local[depth], desk)
                sum_near(targets, sources, same, cell, high, top, limits, desk)
                start = targets.cells[cell, START]
                for i in range(targets.cells[cell, END] - start):
                    out[0, start + i] = total[0, i]
                    out[1, start + i] = total[1, i]
                    out[2, start + i] = total[2, i]
                    if potential:
                        out[3, start + i] = total[4, i]
        return 0

    return walk  # type: ignore[no-any-return]
