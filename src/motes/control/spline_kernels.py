"""Machine code for splines: value, running integral and its inverse from one packed table.

Row 0 of a table describes the whole spline, each other row one segment (`spline.Spline.packed`).
All of it is strict arithmetic, so that a spline has the same bits wherever it is inlined.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import STRICT, jit

# Columns of row 0; times and values of the two ends, what lies beyond them, the whole integral.
FIRST, LAST, BEFORE, AFTER, FIRST_VALUE, LAST_VALUE, FIRST_SLOPE, LAST_SLOPE, TOTAL = range(9)

# Columns of a segment: where it starts, how long it lasts, the cubics of time (from 0 to 1) and of
# value in the parameter u (lowest power first, time's constant being 0), the integral before it.
START, LENGTH, T1, T2, T3, V0, V1, V2, V3, SUM = range(10)

HOLD, LOOP, PINGPONG, EXTEND = range(4)

# Newton's method needs 4 to 6 turns; where it fails, bisection ends within the bits of a double.
TURNS = 60


@jit(flags=STRICT, inline=True)
def _row(table: Any, column: Any, x: Any) -> Any:
    """Last segment whose entry in an ascending column is not above x, or the first segment."""
    low, high = 1, table.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, column] <= x:
            low = middle
        else:
            high = middle
    return low


@jit(flags=STRICT, inline=True)
def _row_before(table: Any, column: Any, x: Any) -> Any:
    """Last segment whose entry in an ascending column is below x, or the first segment."""
    low, high = 1, table.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if table[middle, column] < x:
            low = middle
        else:
            high = middle
    return low


@jit(flags=STRICT, inline=True)
def _time_at(segment: Any, u: Any) -> Any:
    return u * (segment[T1] + u * (segment[T2] + u * segment[T3]))


@jit(flags=STRICT, inline=True)
def _time_rate(segment: Any, u: Any) -> Any:
    return segment[T1] + u * (2.0 * segment[T2] + u * 3.0 * segment[T3])


@jit(flags=STRICT, inline=True)
def _value_at(segment: Any, u: Any) -> Any:
    return segment[V0] + u * (segment[V1] + u * (segment[V2] + u * segment[V3]))


@jit(flags=STRICT, inline=True)
def _integral_at(segment: Any, u: Any) -> Any:
    """Integral over time from the segment's start: of value times time's rate, degree 6 in u."""
    a, b, c = segment[T1], 2.0 * segment[T2], 3.0 * segment[T3]
    v0, v1, v2, v3 = segment[V0], segment[V1], segment[V2], segment[V3]
    tail = (b * v3 + c * v2) / 5.0 + u * (c * v3 / 6.0)
    tail = (a * v3 + b * v2 + c * v1) / 4.0 + u * tail
    tail = (a * v2 + b * v1 + c * v0) / 3.0 + u * tail
    return segment[LENGTH] * u * (a * v0 + u * ((a * v1 + b * v0) / 2.0 + u * tail))


@jit(flags=STRICT, inline=True)
def _next_guess(u: Any, error: Any, rate: Any, low: Any, high: Any) -> Any:
    """Newton's next guess, or the middle of the bracket where that would leave it."""
    guess = u - error / rate if rate > 0.0 else low - 1.0
    return guess if low < guess < high else 0.5 * (low + high)


@jit(flags=STRICT, inline=True)
def _parameter(segment: Any, t: Any) -> Any:
    """The u at which a segment reaches time t."""
    s = (t - segment[START]) / segment[LENGTH]
    if segment[T2] == 0.0 and segment[T3] == 0.0:
        return s
    low, high, u = 0.0, 1.0, s
    for _ in range(TURNS):
        error = _time_at(segment, u) - s
        if error < 0.0:
            low = u
        else:
            high = u
        guess = _next_guess(u, error, _time_rate(segment, u), low, high)
        if abs(guess - u) <= 1e-16 or error == 0.0:
            break
        u = guess
    return u


@jit(flags=STRICT, inline=True)
def _folded(table: Any, mode: Any, t: Any) -> Any:
    """Cycle of time t beyond the ends, and the time inside at which that cycle stands."""
    first, length = table[0, FIRST], table[0, LAST] - table[0, FIRST]
    cycle = np.floor((t - first) / length)
    rest = min(max(t - first - cycle * length, 0.0), length)
    if mode == PINGPONG and cycle % 2.0 == 1.0:
        rest = length - rest
    return cycle, first + rest


@jit(flags=STRICT)
def spline_at(table: Any, t: Any) -> Any:
    """Value of a packed scalar spline at time t, float64."""
    if t < table[0, FIRST]:
        mode, end = table[0, BEFORE], table[0, FIRST]
        value, slope = table[0, FIRST_VALUE], table[0, FIRST_SLOPE]
    else:
        mode, end = table[0, AFTER], table[0, LAST]
        value, slope = table[0, LAST_VALUE], table[0, LAST_SLOPE]
    if t < table[0, FIRST] or t >= table[0, LAST]:
        if mode == HOLD:
            return value
        if mode == EXTEND:
            return value + slope * (t - end)
        t = _folded(table, mode, t)[1]
        if t >= table[0, LAST]:
            return table[0, LAST_VALUE]
    segment = table[_row(table, START, t)]
    return _value_at(segment, _parameter(segment, t))


@jit(flags=STRICT)
def _inner_integral(table: Any, t: Any) -> Any:
    """Integral from the first key to a time between the keys."""
    segment = table[_row(table, START, t)]
    return segment[SUM] + _integral_at(segment, _parameter(segment, t))


@jit(flags=STRICT)
def integral_at(table: Any, t: Any) -> Any:
    """Integral of a packed scalar spline from its first key to time t, float64."""
    first, last, total = table[0, FIRST], table[0, LAST], table[0, TOTAL]
    if first <= t < last:
        return _inner_integral(table, t)
    if t < first:
        mode, beyond, before = table[0, BEFORE], t - first, 0.0
        value, slope = table[0, FIRST_VALUE], table[0, FIRST_SLOPE]
    else:
        mode, beyond, before = table[0, AFTER], t - last, total
        value, slope = table[0, LAST_VALUE], table[0, LAST_SLOPE]
    if mode == HOLD:
        return before + value * beyond
    if mode == EXTEND:
        return before + beyond * (value + 0.5 * slope * beyond)
    cycle, inside = _folded(table, mode, t)
    rest = total if inside >= last else _inner_integral(table, inside)
    if mode == PINGPONG and cycle % 2.0 == 1.0:
        rest = total - rest
    return cycle * total + rest


@jit(flags=STRICT)
def _inner_when(table: Any, amount: Any, earliest: Any) -> Any:
    """Earliest or latest time between the keys at which the integral is `amount`.

    The two differ where the integral rests, which it does for whole segments only: inside a
    segment that is not zero throughout, it rises.
    """
    row = _row_before(table, SUM, amount) if earliest else _row(table, SUM, amount)
    segment = table[row]
    sum_at_end = table[row + 1, SUM] if row + 1 < table.shape[0] else table[0, TOTAL]
    wanted = amount - segment[SUM]
    if wanted <= 0.0:
        return segment[START]
    if amount >= sum_at_end:
        return segment[START] + segment[LENGTH]
    low, high, u = 0.0, 1.0, wanted / (sum_at_end - segment[SUM])
    for _ in range(TURNS):
        error = _integral_at(segment, u) - wanted
        if error < 0.0:
            low = u
        else:
            high = u
        rate = segment[LENGTH] * _value_at(segment, u) * _time_rate(segment, u)
        guess = _next_guess(u, error, rate, low, high)
        if abs(guess - u) <= 1e-16 or error == 0.0:
            break
        u = guess
    return segment[START] + segment[LENGTH] * _time_at(segment, u)


@jit(flags=STRICT)
def when_at(table: Any, amount: Any) -> Any:
    """Earliest time at which `integral_at` of a spline that is nowhere negative is `amount`.

    Infinity if it never is. A last amount that rounding has put past the end counts as reached.
    """
    first, last, total = table[0, FIRST], table[0, LAST], table[0, TOTAL]
    if total < amount <= total * (1.0 + 1e-14):
        amount = total
    if 0.0 <= amount <= total and last > first:
        return _inner_when(table, amount, True)
    if amount < 0.0:
        mode, end, way, missing = table[0, BEFORE], first, -1.0, -amount
        value, slope = table[0, FIRST_VALUE], -table[0, FIRST_SLOPE]
    else:
        mode, end, way, missing = table[0, AFTER], last, 1.0, amount - total
        value, slope = table[0, LAST_VALUE], table[0, LAST_SLOPE]
    if mode == HOLD:
        slope = 0.0
    if mode in (HOLD, EXTEND):
        root = value + np.sqrt(value * value + 2.0 * slope * missing)
        return end + way * (2.0 * missing / root) if missing > 0.0 else end
    if total == 0.0:
        return np.inf
    cycle = np.ceil(amount / total) - 1.0
    rest = min(max(amount - cycle * total, 0.0), total)
    if mode == PINGPONG and cycle % 2.0 == 1.0:
        inside = last - _inner_when(table, total - rest, False)
    else:
        inside = _inner_when(table, rest, True) - first
    return first + cycle * (last - first) + inside


@jit(flags=STRICT)
def values(table: Any, times: Any, out: Any) -> None:
    """`spline_at` of every time."""
    for i in range(times.size):
        out[i] = spline_at(table, times[i])


@jit(flags=STRICT)
def integrals(table: Any, times: Any, out: Any) -> None:
    """Integral from time 0 to every time."""
    origin = integral_at(table, 0.0)
    for i in range(times.size):
        out[i] = integral_at(table, times[i]) - origin


@jit(flags=STRICT)
def instants(table: Any, amounts: Any, out: Any) -> None:
    """Earliest time from 0 on at which the integral from time 0 reaches every amount."""
    origin = integral_at(table, 0.0)
    for i in range(amounts.size):
        reached = when_at(table, amounts[i] + origin)
        out[i] = max(reached, 0.0) if amounts[i] > 0.0 else 0.0
