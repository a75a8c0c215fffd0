"""Which source cells are so far from a target cell that an expansion may stand for them."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from motes.interact.gravity.tree import BALL_RADIUS, CHILDREN, LOW, PULL, SPREAD, X, Y, Z
from motes.jit import EXACT, jit
from motes.machine.lanes import choose
from motes.machine.traced import gathered, traced

LEAST = 0.1
"""Square of the smallest ratio of radii that makes a difference."""


@traced
def seen(balls: Any, chosen: Any) -> Any:
    """Columns of `Tree.balls`, of the rows `chosen`."""
    return tuple(gathered(balls, chosen, CHILDREN + 1))


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

    (others, own, stricter, opening2, reach, e2) -> lanes: whether the balls with the columns
    `others` are far from the ball `own`, and whether they are for the lower order.
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
    def is_far(others: Any, own: Any, stricter: Any, opening2: Any, reach: Any, e2: Any) -> Any:
        x = others[X] - own[X] + (others[LOW] - own[LOW])
        y = others[Y] - own[Y] + (others[LOW + 1] - own[LOW + 1])
        z = others[Z] - own[Z] + (others[LOW + 2] - own[LOW + 2])
        radius, spread, mass = others[BALL_RADIUS], others[SPREAD], others[PULL]
        r2 = x * x + y * y + z * z + e2
        radii = radius + own[BALL_RADIUS]
        gap, square = radii + reach, radii * radii
        inverse = one / r2
        rest = one - square * inverse
        spreads = spread + own[BALL_RADIUS]
        q = np.sqrt(spreads * spreads * inverse)
        own2 = own[BALL_RADIUS] * own[BALL_RADIUS]
        smaller = own2 / (radius * radius + own2 * least)
        pull = mass * inverse * choose(smaller > one, smaller * smaller, one)
        apart = (r2 > gap * gap) & (square < opening2 * r2)
        far = apart & (pull * stricter[0] * power_of_order(q) < rest)
        easy = far & (pull * stricter[1] * power_of_low(q) < rest)
        return far, easy

    if isinstance(is_far, FunctionType):
        # Plain Python: as in machine code, what overflows or is 0 / 0 is no fault, and not far.
        return np.errstate(all="ignore")(is_far)
    return is_far  # type: ignore[no-any-return]
