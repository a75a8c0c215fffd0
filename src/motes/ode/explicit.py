"""Explicit Runge-Kutta methods as pieces of a march."""

from __future__ import annotations

import math

import numpy as np

from motes.ode.arithmetic import Kernel, Sum, estimate, hermite, interpolate, sums
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import Explicit

Y, END = range(2)


def room(table: Explicit) -> Room:
    """Slopes: the stages, those of dense output, the slope at the end. Spare: the interpolant."""
    slopes = len(table.closed) + len(table.a_dense)
    return Room(slopes, 3 + len(table.dense) if table.interpolates else 1)


def pieces(table: Explicit, slope: Kernel, wrap: Wrap, size: int | None) -> Pieces:
    """The method around `slope(t, y, w, row, args)`, which writes f(t, y) into a row of w.

    With the size of the state, kernels are made for it alone, and only other kernels call them.
    """
    last, more = len(table.closed) - 1, len(table.a_dense)
    space = room(table)
    final, spare = FIRST_SLOPE + space.slopes - 1, FIRST_SLOPE + space.slopes
    reuses = table.first_same_as_last

    def weights(row: tuple[float, ...]) -> list[tuple[int, float]]:
        """Weights over stages, end, dense stages by rows of the memory."""
        places = [*range(last), last + more, *range(last, last + more)]
        return [(FIRST_SLOPE + place, x) for place, x in zip(places, row, strict=False)]

    combine = sums([Sum(END, Y, weights(row)) for row in table.closed[1:]], space.rows, size)
    times = np.array((*table.c, 1.0)[: last + 1], float)

    @wrap.part
    def begin(t, y, w, args):  # type: ignore[no-untyped-def]
        slope(t, y, w, FIRST_SLOPE, args)
        return 1

    @wrap.part
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        for i in range(1, last):
            combine(w, i - 1, h)
            slope(t + times[i] * h, end, w, FIRST_SLOPE + i, args)
        combine(w, last - 1, h)
        if reuses:
            slope(t + h, end, w, final, args)
            return last
        return last - 1

    @wrap.part
    def close(t, end, w, args):  # type: ignore[no-untyped-def]
        if reuses:
            return 0
        slope(t, end, w, final, args)
        return 1

    lows = [low for low in (table.b_low, table.b_lower) if low is not None]
    second = len(lows) > 1
    differences = [tuple(np.subtract(table.b, low).tolist()) for low in lows or [table.b]]
    sizes = estimate([Sum(spare, None, weights(row)) for row in differences], space.rows, size)

    @wrap.part
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        high, low = sizes(w, h, rtol, atol)
        if second and high > 0.0:
            # The estimate of order 5, damped by that of order 3 (Hairer, Norsett and Wanner I,
            # eq. II.10.17).
            return high * high / math.sqrt(high * high + 0.01 * low * low), 0
        return high, 0

    if not table.interpolates:
        return Pieces(begin, take, close, error, *partial_step(take, wrap))

    stages = [Sum(spare, Y, weights(row)) for row in table.a_dense]
    rows = [Sum(spare + 3 + m, None, weights(row)) for m, row in enumerate(table.dense)]
    dense = sums([*stages, *rows], space.rows, size)
    dense_times, count = np.array(table.c_dense, float), len(rows)

    @wrap.part
    def prepare(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        n = y.size
        if more:
            reach = w[spare * n : (spare + 1) * n]
            for i in range(more):
                dense(w, i, h)
                slope(t + dense_times[i] * h, reach, w, FIRST_SLOPE + last + i, args)
        hermite(w, n, final, spare, h)
        for i in range(count):
            dense(w, more + i, h)
        return more

    @wrap.part
    def inside(share, t, y, w, h, out, args):  # type: ignore[no-untyped-def]
        interpolate(w, y.size, spare, 3 + count, share, out)
        return 0

    return Pieces(begin, take, close, error, prepare, inside)
