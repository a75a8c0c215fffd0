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

from motes.interact.gravity.acceptance import acceptance, seen
from motes.interact.gravity.desk import Desk, Limits
from motes.interact.gravity.far import far_field, together
from motes.interact.gravity.lanes import LANES, read, write
from motes.interact.gravity.near import near_field
from motes.interact.gravity.translations import translations, width
from motes.interact.gravity.tree import (
    BALL,
    BALL_RADIUS,
    CHILDREN,
    COUNT,
    END,
    FIRST,
    MASS,
    NUMBER,
    PULL,
    RADIUS,
    START,
    Tree,
    X,
    Y,
    Z,
    cell_unit,
)
from motes.jit import EXACT, jit
from motes.machine.lanes import bits, choose, fetch, lowest, put_some, take
from motes.memory import LINE

LARGE = 64
"""Numbers of an expansion from which it is announced that it will be read: few come unannounced in
time."""

OPENED = 1.25
"""Radius of a source cell, in radii of the target cell, from which it is divided first."""


@jit(inline=True)
def _is_wanted(ranges: Any, start: Any, end: Any) -> Any:
    """Whether a cell has particles in one of the ranges, which ascend."""
    low, high = 0, ranges.shape[0]
    while low < high:
        middle = (low + high) // 2
        if ranges[middle, 1] <= start:
            low = middle + 1
        else:
            high = middle
    return low < ranges.shape[0] and ranges[low, 0] < end


@cache
def walker(
    law: str, real: type, mixed: bool, potential: bool, order: int, low_order: int
) -> Callable[..., Any]:
    """Compiled walk for a pair law, numbers of type `real` or `mixed`, with the potential or not.

    (targets, sources, same, ranges, limits, desk, out) -> int: writes to rows 0 to 2 of `out`
    (4, n) the sums of m s dx, and with `potential` to row 3 those of m w, for the particles of
    `targets` in `ranges` (k, 2), first and last + 1, which are whole cells and ascend. Returns 0,
    or 1 if the lists of candidates need more room. `same`: the two trees are one, and a particle is
    among its own sources. Source cells whose expansion of order `low_order` is enough are taken
    with that.
    """
    sum_near = near_field(law, real, mixed, potential)
    harmonic = law != "plummer"
    operations, particles = translations(order, harmonic, real), width(real)
    local_to_local, basis = operations.local_to_local, operations.basis
    lanes_to_local, local_to_particles = operations.lanes_to_local, operations.local_to_particles
    high_to_local = translations(order, harmonic, np.float32).lanes_to_local
    expand = far_field(order, harmonic, real, mixed)
    expand_easily = far_field(low_order, harmonic, real, mixed)
    is_far, batch = acceptance(order, low_order, real), together(real, mixed)
    is_large, of_a_line = basis > LARGE, LINE // np.dtype(np.float32 if mixed else real).itemsize
    single, nothing = real is np.float32, real(0)

    @jit(flags=EXACT, numba=False)
    def gather(
        targets: Tree, sources: Tree, cell: Any, low: Any, high: Any, limits: Limits, desk: Desk
    ) -> Any:
        """Add the local terms of all source cells that are far enough; return the others' end.

        Candidates are those from `low` to `high`; the rest is written from `high` on. Returns -1 if
        there is no room.
        """
        opened, candidates, chosen = desk.opened, desk.candidates, desk.chosen
        far, easy = desk.far[0], desk.far[1]
        own = targets.balls[cell]
        large, e2 = own[BALL_RADIUS] * real(OPENED), real(limits.e2)
        count = targets.cells[cell, END] - targets.cells[cell, START]
        is_leaf = targets.cells[cell, NUMBER] == 0
        allowed = min(limits.error, limits.force / max(targets.bodies[cell, MASS], 1e-300))
        allowed = min(allowed, limits.alike / np.sqrt(np.float64(count)))
        allowed = max(allowed, real(1e-30))
        stricter = real(1.0 / allowed), real(limits.easier / allowed)
        few = real(limits.few // count)
        ascending = read(desk.ascending, 0)
        opening2, reach = real(limits.opening2), real(limits.reach)
        desk.gathered[:] = 0
        if mixed:
            desk.high[:] = 0
        top, depth, accepted, easily = high, 0, 0, 0
        while depth > 0 or low < high:
            # What is not tested in this round is left on the stack of cells to test.
            if depth >= LANES:
                number = LANES
                depth -= LANES
                some = read(opened, depth)
            elif high - low >= LANES:
                number = LANES
                some = read(candidates, low)
                low += LANES
            else:
                while low < high and depth < LANES:
                    opened[depth] = candidates[low]
                    low, depth = low + 1, depth + 1
                number, depth = depth, 0
                some = read(opened, 0)
            valid = ascending < np.int32(number)
            some = choose(valid, some, np.int32(0))
            write(chosen, 0, some)
            if top + LANES > candidates.size:
                return -1
            others = seen(sources.balls, chosen)
            separate, low_order_does = is_far(others, own, stricter, opening2, reach, e2)
            valid, inner = valid & (others[PULL] > nothing), others[CHILDREN] > nothing
            if is_leaf:
                separate = separate & (inner | (others[COUNT] > few))
                divides = inner
            else:
                divides = inner & (others[BALL_RADIUS] >= large)
            separate = separate & valid
            remain = valid & ~separate
            more = put_some(far, accepted, some, separate & ~low_order_does)
            if is_large:
                for k in range(accepted, accepted + more):
                    for part in range(0, basis, of_a_line):
                        if mixed:
                            fetch(sources.rounded[far[k]], part)
                        else:
                            fetch(sources.moments[far[k]], part)
            accepted += more
            easily += put_some(easy, easily, some, separate & low_order_does)
            top += put_some(candidates, top, some, remain & ~divides)
            marks = bits(remain & divides)
            while marks != 0:
                other = chosen[lowest(marks)]
                marks = marks & (marks - np.uint64(1))
                first = sources.cells[other, FIRST]
                last = first + sources.cells[other, NUMBER]
                write(opened, depth, first + ascending)
                depth += last - first
                # Children are tested next, and where theirs begin is read of those that are opened.
                for child in range(first, last):
                    fetch(sources.balls, BALL * child)
                fetch(sources.cells, 4 * first)
                fetch(sources.cells, 4 * last - 1)
            while accepted >= batch:
                expand(sources, own, e2, far, batch, desk)
                accepted -= batch
                write(far, 0, read(far, batch))
            while easily >= batch:
                expand_easily(sources, own, e2, easy, batch, desk)
                easily -= batch
                write(easy, 0, read(easy, batch))
        if accepted > 0 and accepted + easily <= batch:
            for lane in range(easily):
                far[accepted + lane] = easy[lane]
            accepted, easily = accepted + easily, 0
        if accepted > 0:
            expand(sources, own, e2, far, accepted, desk)
        if easily > 0:
            expand_easily(sources, own, e2, easy, easily, desk)
        return top

    @jit(flags=EXACT, numba=False)
    def wait(
        targets: Tree, cell: Any, ranges: Any, low: Any, high: Any, depth: Any, desk: Desk
    ) -> Any:
        """Put a cell's children that own targets in `ranges` on the stack."""
        place, cells, bodies = desk.children, targets.cells, targets.bodies
        scale = 1.0 / cell_unit(bodies[cell, RADIUS])
        lane = 0
        for child in range(cells[cell, FIRST], cells[cell, FIRST] + cells[cell, NUMBER]):
            if _is_wanted(ranges, cells[child, START], cells[child, END]):
                place[0, lane] = (bodies[child, X] - bodies[cell, X]) * scale
                place[1, lane] = (bodies[child, Y] - bodies[cell, Y]) * scale
                place[2, lane] = (bodies[child, Z] - bodies[cell, Z]) * scale
                place[4, lane] = cell_unit(bodies[child, RADIUS]) * scale
                waiting = desk.waiting[depth + lane]
                waiting[0], waiting[1], waiting[2] = child, low, high
                lane += 1
        # What unused lanes write lies above the stack; the cell's own terms are read before.
        local_to_local(place, desk.local[depth], desk.local, depth)
        return depth + lane

    @jit(flags=EXACT, numba=False)
    def finish(targets: Tree, cell: Any, terms: Any, desk: Desk) -> None:
        """Begin the sums of a leaf with the field of its local terms."""
        place, out, body, total = desk.place, desk.gathered, targets.bodies[cell], desk.total
        start, end = targets.cells[cell, START], targets.cells[cell, END]
        scale = real(1.0 / cell_unit(body[RADIUS]))
        count = end - start
        for first in range(0, count, particles):
            for axis in range(3):
                center = real(0.0 if single else body[axis])
                near = take(targets.near, 4 * start + axis * count + first, particles)
                write(place[axis], 0, (near - center) * scale)
            local_to_particles(place, terms, scale, out)
            for axis in range(3):
                write(total[axis], first, take(out[axis], 0, particles))
            write(total[4], first, take(out[3], 0, particles))

    @jit(flags=EXACT, numba=False)
    def walk(
        targets: Tree, sources: Tree, same: Any, ranges: Any, limits: Limits, desk: Desk, out: Any
    ) -> Any:
        total, waiting = desk.total, desk.waiting
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
            if mixed:
                high_to_local(desk.high, desk.local[depth])
            if targets.cells[cell, NUMBER] > 0:
                depth = wait(targets, cell, ranges, high, top, depth, desk)
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
