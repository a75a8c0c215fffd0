"""Moments of far cells to local terms: where most of the time of the far field goes."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from motes.interact.gravity.expansions import (
    MOMENTS,
    SIDE,
    derivatives,
    plus,
    powers,
    products,
    row_of,
    stairs,
    terms,
    without_first,
)
from motes.interact.gravity.translations import width
from motes.machine.traced import (
    forget,
    gathered,
    held,
    inverse_root,
    like,
    ones,
    repeated,
    shifted,
    traced,
    whole,
    zeros,
)

STRAIGHT = 6
"""Highest order at which products of moments and derivatives stay in registers, without loops."""


@cache
def moments_to_local(
    order: int, harmonic: bool, real: type, above: int = -1
) -> Callable[..., None]:
    """The operation in the precision `real`, with products of a degree |a| + |b| > `above` alone.

    (balls, chosen, own, table, e2, places, room, local): adds to `local` (basis, width) the terms,
    in a cell with the ball `own`, of source cells whose balls and moments are rows `chosen` of two
    tables; e2 is the squared softening. Moments of the first degree are taken for 0, as they are
    around centers of mass. `room` (ROOM, width) is written to: derivatives where `row_of` says, and
    scaled moments, whose products are summed in loops; `places` are those of the harmonic kind or
    not. Balls may be in double precision where `real` is single.

    Raises ValueError for an order whose derivatives have no rows.
    """
    if order >= SIDE[harmonic]:
        raise ValueError(f"order = {order} must be at most {SIDE[harmonic] - 1}.")
    kind, lanes = terms(order, harmonic), width(real)
    basis = kind.basis
    others = without_first(basis)

    def formula(
        balls: Any, chosen: Any, own: Any, table: Any, e2: Any, places: Any, room: Any, local: Any
    ) -> None:
        ball = gathered(balls, chosen, 8, lanes)
        one = ones(room[0])
        x, y, z = (like(own[k] - ball[k] + (own[3 + k] - ball[3 + k]), one) for k in range(3))
        inverse = inverse_root(x * x + y * y + z * z + like(e2, one))
        slopes = derivatives(order, harmonic, (x * inverse, y * inverse, z * inverse), one)
        if order > STRAIGHT:
            for t, value in slopes.items():
                if sum(t) > above:
                    room[row_of(t, harmonic)] = value
            forget(room)
        power = powers(order, inverse * like(ball[6], one), inverse)
        given = dict(zip(basis, gathered(table, chosen, len(basis), lanes), strict=True))
        moments = {b: given[b] * power[sum(b)] for b in others}
        if order <= STRAIGHT:
            power = powers(order, inverse * like(own[6], one), one)
            pairs = [
                [
                    (moments[b], slopes[plus(a, b)])
                    for b in others
                    if above < sum(a) + sum(b) <= order
                ]
                for a in basis
            ]
            wanted = [n for n, found in enumerate(pairs) if found]
            for n, value in zip(wanted, products([pairs[n] for n in wanted]), strict=True):
                local[n] = local[n] + value * power[sum(basis[n])]
            return
        for k, b in enumerate(others):
            room[MOMENTS + k] = moments[b]
        forget(room)
        power = powers(order, inverse * like(own[6], one), one)
        for chunk, steps in stairs(kind, held(), above):
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

    return traced(formula, lanes)
