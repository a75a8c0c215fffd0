"""What implicit methods share: the memory, the Jacobian, when an iteration has converged."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from motes.jit import jit
from motes.ode.arithmetic import Array, Kernel, add, copy, norm
from motes.ode.jacobian import (
    ATOL,
    BASE,
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
from motes.ode.march import FIRST_SLOPE, Room
from motes.ode.right_hand_side import Wrap

EXACTLY = 1e-13
"""Newton's tolerance where steps are fixed: what rounding leaves."""


def judge(newton: Newton, wrap: Wrap) -> Kernel:
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


class Frame(NamedTuple):
    """What implicit methods share: size, first spare row, kernels, memory."""

    n: int
    spare: int
    line: Linear
    filter: Linear
    linearise: Kernel
    judge: Kernel
    settle: Kernel
    """settle(time, t, y, w, own, g, args): Newton's method for k = f(time, base + g k) in row `own`
    of the slopes, from what stands there; gives what `take` gives, and the state in its row."""
    room: Room


def frame(slopes: int, a: Array, slope: Kernel, newton: Newton, n: int, wrap: Wrap) -> Frame:
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
    linearise, verdict = linearisation(slope, newton, n, place, wrap), judge(newton, wrap)
    settle = _settling(slope, n, spare, line, newton.iterations, verdict, wrap)
    return Frame(n, spare, line, filtering, linearise, verdict, settle, room)


def _settling(
    slope: Kernel, n: int, spare: int, line: Linear, iterations: int, judge: Kernel, wrap: Wrap
) -> Kernel:
    @wrap.loop
    def settle(time, t, y, w, own, g, args):  # type: ignore[no-untyped-def]
        k = w[own * n : (own + 1) * n]
        base = w[(spare + BASE) * n : (spare + BASE + 1) * n]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        change = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + 1) * n]
        atol, rtol = w[(spare + ATOL) * n : (spare + ATOL + 1) * n], w[(spare + RTOL) * n]
        line.factor(w, g)
        evaluations, last, verdict = 0, math.inf, 0
        for iteration in range(iterations):
            copy(base, state)
            add(state, g, k, state)
            slope(time, state, w, spare + VALUE, args)
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

    return settle


def ends(slope: Kernel, slopes: int, wrap: Wrap) -> tuple[Kernel, Kernel]:
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
