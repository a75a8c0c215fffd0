"""Implicit methods as pieces of a march: Newton's method around stages, compiled where f is."""

from __future__ import annotations

import math

import numpy as np

from motes import linear
from motes.ode.arithmetic import Kernel, add, copy, norm
from motes.ode.backward_difference import backward_difference
from motes.ode.implicit_frame import EXACTLY, Frame, ends, frame, weigh
from motes.ode.jacobian import (
    ATOL,
    BASE,
    ERROR,
    RESIDUAL,
    RTOL,
    STATE,
    VALUE,
    Newton,
)
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.ode.rosenbrock import rosenbrock
from motes.tableau import BackwardDifference, Implicit, Rosenbrock


def pieces(
    table: Implicit | Rosenbrock | BackwardDifference,
    slope: Kernel,
    newton: Newton,
    size: int,
    wrap: Wrap,
) -> tuple[Pieces, Room]:
    """The method around `slope(t, y, w, row, args)`, and the memory that it takes."""
    if isinstance(table, BackwardDifference):
        return backward_difference(slope, newton, size, wrap)
    if isinstance(table, Rosenbrock):
        return rosenbrock(table, slope, newton, size, wrap)
    if table.diagonal:
        return _diagonal(table, slope, newton, size, wrap)
    return _coupled(table, slope, newton, size, wrap)


def _estimate(table: Implicit, frame: Frame, slope: Kernel, wrap: Wrap) -> Kernel:
    """The error: stages that only the estimate needs, their sum, and a filter.

    The filter keeps the estimate small where the problem is stiff: Hairer and Wanner II, eq.
    IV.8.19. Explicit stages after implicit ones make it larger once more: it is filtered twice.
    """
    a, c = np.array(table.a, float), np.array(table.c, float)
    weights = np.subtract(table.b, table.b if table.b_low is None else table.b_low)
    extra = np.array([i for i in table.spare_stages if i > 0], np.int64)
    filters = 2 if len(extra) else 1
    n, spare, line, share = frame.n, frame.spare, frame.filter, table.filter

    @wrap.loop
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        estimate = w[(spare + ERROR) * n : (spare + ERROR + 1) * n]
        result = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        evaluations = 0
        for place in range(extra.size):
            i = extra[place]
            weigh(w, n, spare + STATE, 0, a[i, :i], h)
            slope(t + c[i] * h, state, w, FIRST_SLOPE + 1 + i, args)
            evaluations += 1
        weigh(w, n, spare + RESIDUAL, -1, weights, h)
        line.factor(w, share * h)
        for _ in range(filters):
            evaluations += line.solve(t, y, w, args)
        copy(result, estimate)
        return norm(estimate, y, end, rtol, atol), evaluations

    return error


def _diagonal(
    table: Implicit, slope: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """A method whose stages are solved one by one."""
    slopes = len(table.b) + 2
    shared = frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, linearise, settle = shared.spare, shared.linearise, shared.settle
    a, b, c = np.array(table.a, float), np.array(table.b, float), np.array(table.c, float)
    extra = [i for i in table.spare_stages if i > 0]
    needed = np.array([i for i in range(len(b)) if i not in extra], np.int64)

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args)
        for place in range(needed.size):
            i = needed[place]
            own = FIRST_SLOPE + 1 + i
            if i == 0 and a[i, i] == 0.0:
                copy(w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[own * n : (own + 1) * n])
                continue
            weigh(w, n, spare + BASE, 0, a[i, :i], h)
            if a[i, i] == 0.0:
                slope(t + c[i] * h, w[(spare + BASE) * n : (spare + BASE + 1) * n], w, own, args)
                evaluations += 1
                continue
            guess = own - 1 if i > 1 else FIRST_SLOPE
            copy(w[guess * n : (guess + 1) * n], w[own * n : (own + 1) * n])
            spent = settle(t + c[i] * h, t, y, w, own, h * a[i, i], args)
            evaluations += abs(spent)
            if spent < 0:
                return -evaluations
        weigh(w, n, 1, 0, b, h)
        return evaluations

    begin, close = ends(slope, slopes, wrap)
    error = _estimate(table, shared, slope, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), shared.room


def _coupled(
    table: Implicit, slope: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """A method whose stages, but for an explicit first one, are solved together."""
    first, slopes = int(not any(table.a[0])), len(table.b) + 2
    m = len(table.b) - first
    rows = np.array(table.a[first:], float)
    shared = frame(slopes, rows[:, first:].copy(), slope, newton, n, wrap)
    spare, line, linearise, judge = shared.spare, shared.line, shared.linearise, shared.judge
    b, c = np.array(table.b, float), np.array(table.c, float)
    iterations = newton.iterations
    start = FIRST_SLOPE + 1 + first

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args)
        line.factor(w, h)
        atol, rtol = w[(spare + ATOL) * n : (spare + ATOL + 1) * n], w[(spare + RTOL) * n]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        moved = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        changes = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + m) * n]
        k = w[start * n : (start + m) * n]
        for i in range(FIRST_SLOPE + 1, start + m):
            copy(w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[i * n : (i + 1) * n])
        evaluated, last, verdict = 0, math.inf, 0
        for iteration in range(iterations):
            for i in range(m):
                weigh(w, n, spare + STATE, 0, rows[i], h)
                slope(t + c[first + i] * h, state, w, spare + RESIDUAL + i, args)
            add(changes, -1.0, k, changes)
            evaluated += m + line.solve(t, y, w, args)
            add(k, 1.0, changes, k)
            size = 0.0
            for i in range(m):
                linear.scale(changes[:n], h * rows[i, first], moved)
                for j in range(1, m):
                    add(moved, h * rows[i, first + j], changes[j * n : (j + 1) * n], moved)
                weigh(w, n, spare + STATE, 0, rows[i], h)
                own = norm(moved, state, state, rtol, atol)
                if not own <= size:
                    size = own
            verdict = judge(size, last, iteration, rtol == EXACTLY)
            if verdict != 0:
                break
            last = size
        evaluations += evaluated
        weigh(w, n, 1, 0, b, h)
        return evaluations if verdict > 0 else -evaluations

    begin, close = ends(slope, slopes, wrap)
    error = _estimate(table, shared, slope, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), shared.room
