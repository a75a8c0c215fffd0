"""Which source cells are so far from a target cell that an expansion may stand for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from motes.interact.gravity.traced import all_positive, gathered, ones, traced


@cache
def acceptance(order: int) -> Callable[..., None]:
    """Operation that tests LANES source cells together, for expansions of one order.

    (balls, chosen, own, stricter, opening2, reach, e2, verdict): row 0 of `verdict` becomes 1 where
    the rows `chosen` of `balls` are far from the ball `own`, and 0 elsewhere. The error of the
    acceleration is about M / R^2 q^p / (1 - q^2)^2 with q = (r_A + r_B) / R, the sum of the terms
    that are left out; `stricter` is one over the error that is allowed. q^2 is below `opening2`,
    the balls are more than `reach` apart, and e2 is added to R^2.
    """

    @traced
    def is_far(
        balls: Any, chosen: Any, own: Any, stricter: Any, opening2: Any, reach: Any, e2: Any,
        verdict: Any,
    ) -> None:  # fmt: skip
        given = gathered(balls, chosen, 8)
        x, y, z = (given[k] - own[k] + (given[3 + k] - own[3 + k]) for k in range(3))
        r2 = x * x + y * y + z * z + e2
        radii = given[6] + own[6]
        gap, square = radii + reach, radii * radii
        inverse = ones(r2) / r2
        q2, pull = square * inverse, given[7] * inverse * stricter
        rest = ones(r2) - q2
        rest2 = rest * rest
        neglected = pull * pull * power(q2, order)
        verdict[0] = all_positive(r2 - gap * gap, opening2 * r2 - square, rest2 * rest2 - neglected)

    return is_far


def power(value: Any, exponent: int) -> Any:
    """Whole power, at least the first, by squares."""
    if exponent == 1:
        return value
    root = power(value, exponent // 2)
    return root * root * value if exponent % 2 else root * root
