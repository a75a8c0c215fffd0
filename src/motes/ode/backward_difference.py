"""The second backward differentiation formula as pieces of a march."""

from __future__ import annotations

import numpy as np

from motes.ode.arithmetic import Kernel, copy, hermite, interpolate, norm
from motes.ode.implicit_frame import ends, frame
from motes.ode.jacobian import (
    BASE,
    ERROR,
    RESIDUAL,
    STATE,
    Newton,
)
from motes.ode.march import FIRST_SLOPE, Pieces, Room
from motes.ode.right_hand_side import Wrap


def backward_difference(slope: Kernel, newton: Newton, n: int, wrap: Wrap) -> tuple[Pieces, Room]:
    """The second formula, for steps that may differ; without a past, a backward Euler step.

    With r = h / h_before: y1 = ((1 + r)^2 y0 - r^2 y_before + (1 + r) h f(y1)) / (1 + 2 r). Slopes
    are that at the start, that of the stage, the state before, its distance, this step's length,
    and the slope at the end. The error is the first term that the formula leaves out, its third
    derivative (second, for the first step) from slopes and states at both ends, filtered. Dense
    output is the cubic through both ends.
    """
    slopes = 6
    shared = frame(slopes, np.ones((1, 1)), slope, newton, n, wrap)
    spare, line, linearise, settle = shared.spare, shared.line, shared.linearise, shared.settle
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
        base = w[(spare + BASE) * n : (spare + BASE + 1) * n]
        own = FIRST_SLOPE + 1
        w[length * n] = h
        for i in range(n):
            past = r * r * (y[i] - w[before * n + i])
            base[i] = y[i] + past / (1.0 + 2.0 * r)
        copy(w[FIRST_SLOPE * n : own * n], w[own * n : (own + 1) * n])
        spent = settle(t + h, t, y, w, own, g, args)
        copy(w[(spare + STATE) * n : (spare + STATE + 1) * n], end)
        return evaluations + spent if spent > 0 else spent - evaluations

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

    begin, ending = ends(slope, slopes, wrap)

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

    return Pieces(begin, take, close, error, prepare, inside), shared.room
