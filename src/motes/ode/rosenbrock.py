"""Rosenbrock methods as pieces of a march."""

from __future__ import annotations

import numpy as np

from motes import linear
from motes.ode.arithmetic import Kernel, add, copy, norm
from motes.ode.implicit_frame import ends, frame, weigh
from motes.ode.jacobian import (
    BASE,
    ERROR,
    RESIDUAL,
    STATE,
    Newton,
)
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import Rosenbrock


def rosenbrock(
    table: Rosenbrock, slope: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """A Rosenbrock method: one linear solve for each stage, no iteration."""
    stages, slopes, gamma = table.stages, table.stages + 2, table.gamma
    shared = frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, line, linearise = shared.spare, shared.line, shared.linearise
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

    begin, close = ends(slope, slopes, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), shared.room
