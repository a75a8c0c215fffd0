"""Explicit Runge-Kutta methods as pieces of a march."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from motes.ode.arithmetic import Kernel, clear, combination, hermite, interpolate, norm
from motes.ode.march import Pieces, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import Explicit


def space(table: Explicit) -> tuple[int, int]:
    """Number of slopes, and of rows for dense output."""
    slopes = len(table.closed) + len(table.a_dense)
    return slopes, 3 + len(table.dense) if table.interpolates else slopes


def pieces(table: Explicit, slope: Kernel, wrap: Wrap) -> Pieces:
    """The method around `slope(t, y, out, args)`, which writes f(t, y) into out.

    Slopes k: the stages, those for dense output, and the slope at the end of the step.
    """
    last, more = len(table.closed) - 1, len(table.a_dense)

    def placed(rows: Sequence[Sequence[float]]) -> list[list[float]]:
        """Rows over stages, end, dense stages, in the order of k."""
        filled = [[*row, *[0.0] * (last + more + 1 - len(row))] for row in rows]
        return [[*row[:last], *row[last + 1 :], row[last]] for row in filled]

    lows = [low for low in (table.b_low, table.b_lower) if low is not None]
    estimates = [np.subtract(table.b, low).tolist() for low in lows]
    second = len(estimates) > 1
    combine = combination(table.closed)
    times = np.array((*table.c, 1.0)[: last + 1], float)

    @wrap.part
    def begin(t, y, k, args):  # type: ignore[no-untyped-def]
        slope(t, y, k[0], args)
        return 1

    @wrap.part
    def take(t, y, k, end, h, args):  # type: ignore[no-untyped-def]
        for i in range(1, last + 1):
            combine(i, y, k, h, end)
            if i < last:
                slope(t + times[i] * h, end, k[i], args)
        return last - 1

    @wrap.part
    def close(t, end, k, args):  # type: ignore[no-untyped-def]
        slope(t, end, k[k.shape[0] - 1], args)
        return 1

    estimate = combination(placed(estimates))

    @wrap.part
    def error(t, y, end, k, h, rows, rtol, atol):  # type: ignore[no-untyped-def]
        clear(rows[2])
        estimate(0, rows[2], k, h, rows[0])
        size = norm(rows[0], y, end, rtol, atol)
        if second and size > 0.0:
            # The estimate of order 5, damped by that of order 3 (Hairer, Norsett and Wanner I,
            # eq. II.10.17).
            estimate(1, rows[2], k, h, rows[1])
            other = norm(rows[1], y, end, rtol, atol)
            return size * size / math.sqrt(size * size + 0.01 * other * other)
        return size

    if not table.interpolates:
        return Pieces(begin, take, close, error, *partial_step(take, wrap))

    dense = combination(placed((*table.a_dense, *table.dense)))
    dense_times = np.array(table.c_dense, float)

    @wrap.part
    def prepare(t, y, end, k, h, rows, args):  # type: ignore[no-untyped-def]
        for i in range(more):
            dense(i, y, k, h, rows[0])
            slope(t + dense_times[i] * h, rows[0], k[last + i], args)
        hermite(y, end, k, h, rows)
        for i in range(3, rows.shape[0]):
            clear(rows[i])
            dense(more + i - 3, rows[i], k, h, rows[i])
        return more

    @wrap.part
    def inside(share, t, y, k, h, rows, out, args):  # type: ignore[no-untyped-def]
        interpolate(y, rows, share, out)
        return 0

    return Pieces(begin, take, close, error, prepare, inside)
