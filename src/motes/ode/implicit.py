"""Implicit methods as pieces of a march: Newton's method around stages, compiled where f is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from motes.jit import jit
from motes.ode import linear
from motes.ode.arithmetic import Array, Kernel, add, copy, hermite, interpolate, norm
from motes.ode.jacobian import (
    ATOL,
    BASE,
    ERROR,
    RESIDUAL,
    RTOL,
    STATE,
    VALUE,
    Linear,
    Newton,
    Place,
    linearisation,
    solver,
)
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import BackwardDifference, Implicit, Rosenbrock

EXACTLY = 1e-13
"""Newton's tolerance where steps are fixed: what rounding leaves."""


def pieces(
    table: Implicit | Rosenbrock | BackwardDifference,
    slope: Kernel,
    newton: Newton,
    size: int,
    wrap: Wrap,
) -> tuple[Pieces, Room]:
    """The method around `slope(t, y, w, row, args)`, and the memory that it takes."""
    if isinstance(table, BackwardDifference):
        return _backward_difference(slope, newton, size, wrap)
    if isinstance(table, Rosenbrock):
        return _rosenbrock(table, slope, newton, size, wrap)
    if table.diagonal:
        return _diagonal(table, slope, newton, size, wrap)
    return _coupled(table, slope, newton, size, wrap)


def _judge(newton: Newton, wrap: Wrap) -> Kernel:
    """judge(size, last, iteration, exact) -> 1: converged, -1: no solution, 0: go on.

    The change of the states must fall below a share of the tolerance (Hairer and Wanner, Solving
    Ordinary Differential Equations II, section IV.8). Rounding stops an iteration that should be
    exact before it gets there: that is as good.
    """
    most = newton.iterations

    @wrap.part
    def judge(size, last, iteration, exact):  # type: ignore[no-untyped-def]
        if size <= 1.0:
            return 1
        if not size < math.inf:
            return -1
        if size > 2.0 * last or (exact and size > 0.5 * last and size < 1e5):
            return 1 if exact and size < 1e5 else -1
        if iteration == most - 1:
            return 1 if exact and size < 1e5 else -1
        return 0

    return judge


@jit
def weigh(w: Array, n: int, target: int, base: int, weights: Array, h: float) -> None:
    """Row `target` = row `base`, or 0 if that is negative, + h sum_j weights_j slope_j.

    Slopes of stages come after that at the start of the step.
    """
    for i in range(n):
        w[target * n + i] = w[base * n + i] if base >= 0 else 0.0
    for j in range(weights.size):
        if weights[j] != 0.0:
            for i in range(n):
                w[target * n + i] += h * weights[j] * w[(FIRST_SLOPE + 1 + j) * n + i]


class _Frame(NamedTuple):
    """What implicit methods share: size, first spare row, kernels, memory."""

    n: int
    spare: int
    line: Linear
    filter: Linear
    linearise: Kernel
    judge: Kernel
    room: Room


def _frame(slopes: int, a: Array, slope: Kernel, newton: Newton, n: int, wrap: Wrap) -> _Frame:
    """`a` is what is solved at once; an error estimate is filtered by a solve of one stage."""
    spare = FIRST_SLOPE + slopes
    jacobian = spare + RESIDUAL + len(a)
    place = Place(spare, jacobian, jacobian + (0 if newton.solver == "krylov" else n))
    line = solver(slope, newton, n, a, place, wrap)
    rows, filtering = line.rows, line
    if len(a) > 1:
        after = place._replace(solver=place.solver + rows)
        filtering = solver(slope, newton, n, np.ones((1, 1)), after, wrap)
        rows += filtering.rows
    room = Room(slopes, place.solver + rows - spare, spare + ATOL)
    linearise = linearisation(slope, newton, n, place, wrap)
    return _Frame(n, spare, line, filtering, linearise, _judge(newton, wrap), room)


def _ends(slope: Kernel, slopes: int, wrap: Wrap) -> tuple[Kernel, Kernel]:
    """`begin` and `close`."""
    final = FIRST_SLOPE + slopes - 1

    @wrap.part
    def begin(t, y, w, args):  # type: ignore[no-untyped-def]
        slope(t, y, w, FIRST_SLOPE, args)
        return 1

    @wrap.part
    def close(t, end, w, args):  # type: ignore[no-untyped-def]
        slope(t, end, w, final, args)
        return 1

    return begin, close


def _estimate(table: Implicit, frame: _Frame, slope: Kernel, wrap: Wrap) -> Kernel:
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
        for i in extra:
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
    frame = _frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, line, linearise, judge = frame.spare, frame.line, frame.linearise, frame.judge
    a, b, c = np.array(table.a, float), np.array(table.b, float), np.array(table.c, float)
    extra = [i for i in table.spare_stages if i > 0]
    needed = np.array([i for i in range(len(b)) if i not in extra], np.int64)
    iterations = newton.iterations

    @wrap.loop
    def stage(i, t, y, w, h, args):  # type: ignore[no-untyped-def]
        """Newton's method for k_i = f(t + c_i h, base + h a_ii k_i); gives what `take` gives."""
        own, g = FIRST_SLOPE + 1 + i, h * a[i, i]
        k = w[own * n : (own + 1) * n]
        base = w[(spare + BASE) * n : (spare + BASE + 1) * n]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        change = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        atol, rtol = w[(spare + ATOL) * n : (spare + ATOL + 1) * n], w[(spare + RTOL) * n]
        line.factor(w, g)
        guess = own - 1 if i > 1 else FIRST_SLOPE
        copy(w[guess * n : (guess + 1) * n], k)
        evaluations, last, verdict = 0, math.inf, 0
        for iteration in range(iterations):
            copy(base, state)
            add(state, g, k, state)
            slope(t + c[i] * h, state, w, spare + VALUE, args)
            copy(value, change)
            add(change, -1.0, k, change)
            evaluations += 1 + line.solve(t, y, w, args)
            add(k, 1.0, change, k)
            copy(base, state)
            add(state, g, k, state)
            size = abs(g) * norm(change, state, state, rtol, atol)
            verdict = judge(size, last, iteration, rtol == EXACTLY)
            if verdict != 0:
                break
            last = size
        return evaluations if verdict > 0 else -evaluations

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args)
        for i in needed:
            own = FIRST_SLOPE + 1 + i
            if i == 0 and a[i, i] == 0.0:
                copy(w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[own * n : (own + 1) * n])
                continue
            weigh(w, n, spare + BASE, 0, a[i, :i], h)
            if a[i, i] == 0.0:
                slope(t + c[i] * h, w[(spare + BASE) * n : (spare + BASE + 1) * n], w, own, args)
                evaluations += 1
                continue
            spent = stage(i, t, y, w, h, args)
            evaluations += abs(spent)
            if spent < 0:
                return -evaluations
        weigh(w, n, 1, 0, b, h)
        return evaluations

    begin, close = _ends(slope, slopes, wrap)
    error = _estimate(table, frame, slope, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), frame.room


def _coupled(
    table: Implicit, slope: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """A method whose stages, but for an explicit first one, are solved together."""
    first, slopes = int(not any(table.a[0])), len(table.b) + 2
    m = len(table.b) - first
    rows = np.array(table.a[first:], float)
    frame = _frame(slopes, rows[:, first:].copy(), slope, newton, n, wrap)
    spare, line, linearise, judge = frame.spare, frame.line, frame.linearise, frame.judge
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

    begin, close = _ends(slope, slopes, wrap)
    error = _estimate(table, frame, slope, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), frame.room


def _rosenbrock(
    table: Rosenbrock, slope: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """A Rosenbrock method: one linear solve for each stage, no iteration."""
    stages, slopes, gamma = table.stages, table.stages + 2, table.gamma
    frame = _frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, line, linearise = frame.spare, frame.line, frame.linearise
    a, d = np.zeros((stages, stages)), np.zeros((stages, stages))
    for i, (left, right) in enumerate(zip(table.a, table.d, strict=True)):
        a[i, :i], d[i, :i] = left, right
    b, weights = np.array(table.b, float), np.subtract(table.b, table.b_low)
    c, drifts = np.array(table.c, float), np.array(table.g, float)

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args) + 1
        # 1 / (gamma h) - J is (I - gamma h J) / (gamma h).
        line.factor(w, gamma * h)
        start = w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        value = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        drift = w[(spare + BASE) * n : (spare + BASE + 1) * n]
        moment = 1e-8 * max(abs(t), abs(h))
        slope(t + moment, y, w, spare + BASE, args)
        add(drift, -1.0, start, drift)
        for i in range(stages):
            copy(start, value)
            if i > 0:
                weigh(w, n, spare + STATE, 0, a[i, :i], 1.0)
                slope(t + c[i] * h, state, w, spare + RESIDUAL, args)
                weigh(w, n, spare + RESIDUAL, spare + RESIDUAL, d[i, :i], 1.0 / h)
                evaluations += 1
            add(value, h * drifts[i] / moment, drift, value)
            evaluations += line.solve(t, y, w, args)
            linear.scale(value, gamma * h, w[(FIRST_SLOPE + 1 + i) * n : (FIRST_SLOPE + 2 + i) * n])
        weigh(w, n, 1, 0, b, 1.0)
        return evaluations

    @wrap.loop
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        weigh(w, n, spare + ERROR, -1, weights, 1.0)
        estimate = w[(spare + ERROR) * n : (spare + ERROR + 1) * n]
        return norm(estimate, y, end, rtol, atol), 0

    begin, close = _ends(slope, slopes, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), frame.room


def _backward_difference(slope: Kernel, newton: Newton, n: int, wrap: Wrap) -> tuple[Pieces, Room]:
    """The second formula, for steps that may differ; without a past, a backward Euler step.

    With r = h / h_before: y1 = ((1 + r)^2 y0 - r^2 y_before + (1 + r) h f(y1)) / (1 + 2 r). Slopes
    are that at the start, that of the stage, the state before, its distance, this step's length,
    and the slope at the end. The error is the first term that the formula leaves out, its third
    derivative (second, for the first step) from slopes and states at both ends, filtered. Dense
    output is the cubic through both ends.
    """
    slopes = 6
    frame = _frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, line, linearise, judge = frame.spare, frame.line, frame.linearise, frame.judge
    iterations = newton.iterations
    before, distance, length, final = range(FIRST_SLOPE + 2, FIRST_SLOPE + 6)

    @wrap.part
    def share(w, h):  # type: ignore[no-untyped-def]
        """h / h_before, 0 without a past; and the share of h with which f(y1) counts."""
        past = w[distance * n]
        r = h / past if past != 0.0 else 0.0
        return r, (1.0 + r) / (1.0 + 2.0 * r)

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args)
        r, g = share(w, h)
        g *= h
        line.factor(w, g)
        base = w[(spare + BASE) * n : (spare + BASE + 1) * n]
        k = w[(FIRST_SLOPE + 1) * n : (FIRST_SLOPE + 2) * n]
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        change = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        atol, rtol = w[(spare + ATOL) * n : (spare + ATOL + 1) * n], w[(spare + RTOL) * n]
        w[length * n] = h
        for i in range(n):
            past = r * r * (y[i] - w[before * n + i])
            base[i] = y[i] + past / (1.0 + 2.0 * r)
        copy(w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], k)
        evaluated, last, verdict = 0, math.inf, 0
        for iteration in range(iterations):
            copy(base, end)
            add(end, g, k, end)
            slope(t + h, end, w, spare + VALUE, args)
            copy(value, change)
            add(change, -1.0, k, change)
            evaluated += 1 + line.solve(t, y, w, args)
            add(k, 1.0, change, k)
            copy(base, end)
            add(end, g, k, end)
            size = abs(g) * norm(change, end, end, rtol, atol)
            verdict = judge(size, last, iteration, rtol == EXACTLY)
            if verdict != 0:
                break
            last = size
        evaluations += evaluated
        return evaluations if verdict > 0 else -evaluations

    @wrap.loop
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        r, g = share(w, h)
        result = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        first, last = FIRST_SLOPE * n, (FIRST_SLOPE + 1) * n
        if r == 0.0:
            for i in range(n):
                result[i] = 0.5 * h * (w[first + i] - w[last + i])
        else:
            left = (1.0 - 1.0 / (r * (1.0 + 2.0 * r))) / 6.0 - 0.5 * g
            for i in range(n):
                mean = 0.5 * h * (w[first + i] + w[last + i])
                result[i] = left * 12.0 * (mean - (end[i] - y[i]))
        evaluations = line.solve(t, y, w, args)
        estimate = w[(spare + ERROR) * n : (spare + ERROR + 1) * n]
        copy(result, estimate)
        return norm(estimate, y, end, rtol, atol), evaluations

    begin, ending = _ends(slope, slopes, wrap)

    @wrap.part
    def close(t, end, w, args):  # type: ignore[no-untyped-def]
        copy(w[:n], w[before * n : (before + 1) * n])
        w[distance * n] = w[length * n]
        return ending(t, end, w, args)

    @wrap.part
    def prepare(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        hermite(w, n, final, spare + STATE, h)
        return 0

    @wrap.part
    def inside(share, t, y, w, h, out, args):  # type: ignore[no-untyped-def]
        interpolate(w, n, spare + STATE, 3, share, out)
        return 0

    return Pieces(begin, take, close, error, prepare, inside), frame.room
