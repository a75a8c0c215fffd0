"""The operations on expansions: particles to moments, moments to moments, to local terms, to field.

Lengths are in units of a cell's radius h and, between two cells, of their distance R, so that no
power under- or overflows in single precision: moments are kept as M_b / h^|b| and local terms as
L_a h^|a|. Up to LANES particles, children or source cells go through an operation together; each
operation is straight-line code for its order.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from motes.interact.gravity.expansions import (
    MOMENTS,
    UNITS,
    derivatives,
    folded,
    monomials,
    plus,
    powers,
    products,
    row_of,
    shifted_moments,
    shifted_terms,
    stairs,
    terms,
    unfolded,
    without_first,
)
from motes.machine.traced import (
    LANES,
    forget,
    gathered,
    held,
    inverse_root,
    ones,
    repeated,
    rows,
    scattered,
    shifted,
    total,
    traced,
    whole,
    write,
    write_totals,
    zeros,
)

STRAIGHT = 6
"""Highest order at which products of moments and derivatives stay in registers, without loops."""

Operation = Callable[..., None]


class Translations(NamedTuple):
    """The operations of one order, for kernels. `place` is (5, LANES) throughout."""

    particles_to_moments: Operation
    """(place, sums): add to `sums` (every, LANES) those of particles at -place[:3], masses
    place[3], in units of the cell's radius."""
    sums_to_moments: Operation
    """(sums, moments): the moments (basis,) of a cell."""
    moments_to_moments: Operation
    """(place, chosen, table, moments): moments (basis,) of a cell from rows `chosen` of a table,
    those of its children; place[:3] is the parent's center from the child's and place[4] the
    child's radius, in the parent's radius; place[3] is 1, and 0 in unused lanes."""
    moments_to_local: Operation
    """(balls, chosen, own, table, e2, places, room, local): add to `local` (basis, LANES) the
    terms, in a cell with the ball `own`, of source cells whose balls and moments are rows `chosen`
    of two tables; e2 is the squared softening. Moments of the first degree are taken for 0, as they
    are around centers of mass. `room` (ROOM, LANES) is written to: derivatives where `row_of` says,
    and scaled moments, whose products are summed in loops; `places` are those of the harmonic kind
    or not."""
    lanes_to_local: Operation
    """(local, terms): add the lane sums of `local` (basis, LANES) to terms (basis,)."""
    local_to_local: Operation
    """(place, terms, table, first): terms of a cell's children in rows `first` + lane of a table;
    place[:3] is the child's center from the cell's, and place[4] its radius, in the cell's."""
    local_to_particles: Operation
    """(place, terms, scale, out): to rows 0 to 2 of `out` the gradient at place[:3], in the cell's
    radius, times `scale`, and to row 3 the value."""
    basis: int
    """Numbers in an expansion."""
    every: int
    """Terms in all."""


@cache
def translations(order: int, harmonic: bool) -> Translations:
    """The operations on expansions of one order."""
    kind = terms(order, harmonic)
    basis, every = kind.basis, kind.every

    @traced
    def particles_to_moments(place: Any, sums: Any) -> None:
        found = monomials(order, (place[0], place[1], place[2]), place[3])
        write(sums, [old + found[t] for t, old in zip(every, rows(sums, len(every)), strict=True)])

    @traced
    def sums_to_moments(sums: Any, moments: Any) -> None:
        whole = dict(zip(every, rows(sums, len(every)), strict=True))
        write_totals(moments, folded(kind, whole))

    @traced
    def moments_to_moments(place: Any, chosen: Any, table: Any, moments: Any) -> None:
        power = powers(order, place[4], place[3])
        given = gathered(table, chosen, len(basis))
        old = {b: m * power[sum(b)] for b, m in zip(basis, given, strict=True)}
        new = shifted_moments(kind, old, (place[0], place[1], place[2]))
        write_totals(moments, folded(kind, new))

    @traced
    def moments_to_local(
        balls: Any, chosen: Any, own: Any, table: Any, e2: Any, places: Any, room: Any, local: Any
    ) -> None:
        ball = gathered(balls, chosen, 8)
        x, y, z = (own[k] - ball[k] + (own[3 + k] - ball[3 + k]) for k in range(3))
        inverse = inverse_root(x * x + y * y + z * z + e2)
        slopes = derivatives(order, harmonic, (x * inverse, y * inverse, z * inverse), ones(x))
        others = without_first(basis)
        if order > STRAIGHT:
            for t, value in slopes.items():
                room[row_of(t, harmonic)] = value
            forget(room)
        power = powers(order, ball[6] * inverse, inverse)
        given = dict(zip(basis, gathered(table, chosen, len(basis)), strict=True))
        moments = {b: given[b] * power[sum(b)] for b in others}
        if order <= STRAIGHT:
            power = powers(order, own[6] * inverse, ones(x))
            pairs = [
                [(moments[b], slopes[plus(a, b)]) for b in others if sum(a) + sum(b) <= order]
                for a in basis
            ]
            for n, value in enumerate(products(pairs)):
                local[n] = local[n] + value * power[sum(basis[n])]
            return
        for k, b in enumerate(others):
            room[MOMENTS + k] = moments[b]
        forget(room)
        power = powers(order, own[6] * inverse, ones(x))
        for chunk, steps in stairs(kind, held(x)):
            sums = {n: zeros(x) for n in chunk}
            for some, first, last in steps:
                shifts = [row_of(basis[n], harmonic) for n in some]

                def add(k: Any, sums: list[Any], shifts: list[int] = shifts) -> list[Any]:
                    moment = shifted(room, k, [MOMENTS])[0]
                    row = row_of(others[k], harmonic) if isinstance(k, int) else whole(places, k)
                    near = shifted(room, row, shifts)
                    return [old + moment * slope for old, slope in zip(sums, near, strict=True)]

                found = repeated(room, first, last, [sums[n] for n in some], add)
                sums.update(zip(some, found, strict=True))
            for n, value in sums.items():
                local[n] = local[n] + value * power[sum(basis[n])]

    @traced
    def lanes_to_local(local: Any, terms: Any) -> None:
        for row in range(len(basis)):
            terms[row] = terms[row] + total(local[row])

    @traced
    def local_to_local(place: Any, terms: Any, table: Any, first: Any) -> None:
        whole = unfolded(kind, rows(terms, len(basis)))
        power = powers(order, place[4], ones(place[4]))
        new = shifted_terms(kind, whole, (place[0], place[1], place[2]))
        scattered([v * power[sum(a)] for a, v in zip(basis, new, strict=True)], table, first)

    @traced
    def local_to_particles(place: Any, terms: Any, scale: Any, out: Any) -> None:
        whole = unfolded(kind, rows(terms, len(basis)))
        shift = monomials(order, (place[0], place[1], place[2]), ones(place[0]))
        inner = [t for t in every if sum(t) < order]
        sums = [[(whole[plus(t, unit)], shift[t]) for t in inner] for unit in UNITS]
        x, y, z, value = products([*sums, [(whole[t], shift[t]) for t in every]])
        out[0], out[1], out[2], out[3] = x * scale, y * scale, z * scale, value

    return Translations(
        particles_to_moments,
        sums_to_moments,
        moments_to_moments,
        moments_to_local,
        lanes_to_local,
        local_to_local,
        local_to_particles,
        len(basis),
        len(every),
    )


def padded(count: int) -> int:
    """Columns of a table of expansions of `count` numbers."""
    return -(-count // LANES) * LANES
