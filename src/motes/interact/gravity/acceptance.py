"""Which source cells are so far from a target cell that an expansion may stand for them."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from motes.jit import EXACT, jit
from motes.machine.lanes import choose
from motes.machine.traced import gathered, traced

LEAST = 0.1
"""Square of the smallest ratio of radii that makes a difference."""


@traced
def offsets(balls: Any, chosen: Any, own: Any) -> Any:
    """x, y, z from the ball `own`, radius and spread of rows `chosen` of a table of balls."""
    given = gathered(balls, chosen, 8)
    x, y, z = (given[k] - own[k] + (given[3 + k] - own[3 + k]) for k in range(3))
    return x, y, z, given[6], given[7]


@traced
def columns(contents: Any, chosen: Any) -> Any:
    """Mass, number of particles and of children of rows `chosen` of a table of contents."""
    return tuple(gathered(contents, chosen, 4)[:3])


@cache
def power(exponent: int) -> Callable[..., Any]:
    """Compiled function x -> x^exponent, an exponent of at least 1, by squares."""
    if exponent == 1:
        return jit(inline=True)(lambda x: x)  # type: ignore[no-any-return]
    root, odd = power(exponent // 2), exponent % 2 == 1

    @jit(inline=True, flags=EXACT)
    def raised(x: Any) -> Any:
        y = root(x)
        return y * y * x if odd else y * y

    return raised  # type: ignore[no-any-return]


@cache
def acceptance(order: int, low: int, real: type) -> Callable[..., Any]:
    """Compiled function that tests LANES source cells together, for expansions of two orders.

    (balls, chosen, mass, own, stricter, opening2, reach, e2) -> lanes: whether the rows `chosen` of
    `balls` are far from the ball `own`, whether they are for the lower order, and their radii.
    Sources s from B's center make an error of about sum m (r_A + s)^p / R^(p + 2) / (1 - q^2) in
    the acceleration at distance r_A from A's, the sum of the terms that are left out, with
    q = (r_A + r_B) / R. By Minkowski's inequality that sum is at most M (r_A + S)^p with B's spread
    S = (sum m s^p / M)^(1/p): a few light bodies at the edge of B count for little. Cells smaller
    than the target come in crowds, and errors that the target's radius makes are alike for a crowd:
    M then stands for M (r_A / r_B)^4, less where r_B is tiny. `stricter` is one over the error that
    is allowed, for both orders. q^2 is below `opening2`, the balls are more than `reach` apart, and
    e2 is added to R^2.
    """
    one, least = real(1), real(LEAST)
    power_of_order, power_of_low = power(order), power(low)

    @jit(inline=True, flags=EXACT)
    def is_far(
        balls: Any, chosen: Any, mass: Any, own: Any, stricter: Any, opening2: Any, reach: Any,
        e2: Any,
    ) -> Any:  # fmt: skip
        x, y, z, radius, spread = offsets(balls, chosen, own)
        r2 = x * x + y * y + z * z + e2
        radii = radius + own[6]
        gap, square = radii + reach, radii * radii
        inverse = one / r2
        rest = one - square * inverse
        spreads = spread + own[6]
        q = np.sqrt(spreads * spreads * inverse)
        own2 = own[6] * own[6]
        smaller = own2 / (radius * radius + own2 * least)
        pull = mass * inverse * choose(smaller > one, smaller * smaller, one)
        apart = (r2 > gap * gap) & (square < opening2 * r2)
        far = apart & (pull * stricter[0] * power_of_order(q) < rest)
        easy = far & (pull * stricter[1] * power_of_low(q) < rest)
        return far, easy, radius

    if isinstance(is_far, FunctionType):
        # Plain Python: as in machine code, what overflows or is 0 / 0 is no fault, and not far.
        return np.errstate(all="ignore")(is_far)
    return is_far  # type: ignore[no-any-return]
