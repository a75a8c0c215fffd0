"""Implicit-explicit pairs as pieces of a march: y' = f + g, only g is solved for."""

from __future__ import annotations

import numpy as np

from motes.ode.arithmetic import Kernel, copy, norm
from motes.ode.implicit_frame import ends, frame, weigh
from motes.ode.jacobian import BASE, ERROR, STATE, Newton
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import Implicit


def additive(
    table: Implicit, slope: Kernel, stiff: Kernel, newton: Newton, n: int, wrap: Wrap
) -> tuple[Pieces, Room]:
    """The pair around f, `slope`, and g, `stiff`, both called as (t, y, w, row, args).

    Stage i is y_i = y + h sum_j (e_ij f_j + a_ij g_j): g_i by Newton's method, then f_i = f(y_i).
    Slopes are g at the start of the step, those of g in all stages, those of f, and g at the end.
    Kennedy and Carpenter 2003, section 2.
    """
    stages = len(table.b)
    slopes = 2 * stages + 2
    shared = frame(slopes, np.ones((1, 1)), stiff, newton, n, wrap)
    spare, linearise, settle = shared.spare, shared.linearise, shared.settle
    rows = np.zeros((stages, 2 * stages))
    for i in range(stages):
        rows[i, :i] = table.a[i][:i]
        rows[i, stages : stages + i] = table.a_explicit[i]
    diagonal, c = np.array([row[i] for i, row in enumerate(table.a)]), np.array(table.c, float)
    b = np.array((*table.b, *table.b), float)
    low = b if table.b_low is None else np.array((*table.b_low, *table.b_low), float)
    weights = b - low
    implicit, explicit = FIRST_SLOPE + 1, FIRST_SLOPE + 1 + stages

    @wrap.loop
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        evaluations = linearise(t, y, w, args)
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        for i in range(stages):
            own = implicit + i
            weigh(w, n, spare + BASE, 0, rows[i], h)
            if diagonal[i] == 0.0:
                # The first stage: the state at the start, where g is known.
                copy(w[(spare + BASE) * n : (spare + BASE + 1) * n], state)
                copy(w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[own * n : (own + 1) * n])
            else:
                copy(w[(own - 1) * n : own * n], w[own * n : (own + 1) * n])
                spent = settle(t + c[i] * h, t, y, w, own, h * diagonal[i], args)
                evaluations += abs(spent)
                if spent < 0:
                    return -evaluations
            slope(t + c[i] * h, state, w, explicit + i, args)
            evaluations += 1
        weigh(w, n, 1, 0, b, h)
        return evaluations

    @wrap.loop
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        estimate = w[(spare + ERROR) * n : (spare + ERROR + 1) * n]
        # Not filtered as in methods that solve for all of y': errors of the explicit part are not
        # damped, and a filter would hide them.
        weigh(w, n, spare + ERROR, -1, weights, h)
        return norm(estimate, y, end, rtol, atol), 0

    begin, close = ends(stiff, slopes, wrap)
    return Pieces(begin, take, close, error, *partial_step(take, wrap)), shared.room
