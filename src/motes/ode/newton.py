"""Splittings and Nystrom methods as pieces of a march: the state is (x, v), one after the other."""

from __future__ import annotations

import math

import numpy as np

from motes.ode.arithmetic import Kernel, add, copy
from motes.ode.march import FIRST_SLOPE, Pieces, Room, partial_step
from motes.ode.right_hand_side import Wrap
from motes.tableau import Nystrom, Splitting

SPLITTING = Room(1, 1)
"""Slopes: the acceleration at the start of the step, or at its end; spare: that of other kicks."""


def splitting(
    table: Splitting, acceleration: Kernel, wrap: Wrap, *, conservative: bool, drag: bool
) -> Pieces:
    """Kicks and drifts around `acceleration(t, x, v, out, args)`.

    With `conservative`, the acceleration does not depend on v, and that of a last kick serves the
    next step's first one. With `drag`, args begin with the rates k of v' = a - k v, which each kick
    solves exactly: v exp(-k g) + a (1 - exp(-k g)) / k over its length g.
    """
    kicks, drifts = np.array(table.kicks, float), np.array((*table.drifts, 0.0), float)
    times, count = np.array(table.times, float), len(table.kicks)
    reuse = conservative and table.kicks[0] != 0 and table.kicks[-1] != 0

    @wrap.part
    def begin(t, y, w, args):  # type: ignore[no-untyped-def]
        if reuse:
            n = y.size // 2
            acceleration(t, y[:n], y[n:], w[4 * n : 5 * n], args)
            return 1
        return 0

    @wrap.part
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        n = y.size // 2
        copy(y, end)
        x, v, first, a = end[:n], end[n:], w[4 * n : 5 * n], w[6 * n : 7 * n]
        evaluations = 0
        for i in range(count):
            if kicks[i] != 0.0:
                if i == 0 and reuse:
                    kick(v, first, kicks[i] * h, args)
                else:
                    acceleration(t + times[i] * h, x, v, a, args)
                    evaluations += 1
                    kick(v, a, kicks[i] * h, args)
            add(x, drifts[i] * h, v, x)
        return evaluations

    @wrap.part
    def close(t, end, w, args):  # type: ignore[no-untyped-def]
        if reuse:
            n = end.size // 2
            copy(w[6 * n : 7 * n], w[4 * n : 5 * n])
        return 0

    kick = _kick(wrap, drag)
    return Pieces(begin, take, close, _no_error(wrap), *partial_step(take, wrap))


def nystrom(table: Nystrom, acceleration: Kernel, wrap: Wrap) -> Pieces:
    """A Nystrom method around `acceleration(t, x, v, out, args)`, which does not depend on v."""
    stages = table.stages
    a = np.zeros((stages, stages))
    for i, row in enumerate(table.a):
        a[i, : len(row)] = row
    b, b_position = np.array(table.b, float), np.array(table.b_position, float)
    times = np.array(table.c, float)

    @wrap.part
    def begin(t, y, w, args):  # type: ignore[no-untyped-def]
        return 0

    @wrap.part
    def take(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        n = y.size // 2
        x, v, k = end[:n], end[n:], w[2 * FIRST_SLOPE * n :]
        for i in range(stages):
            add(y[:n], times[i] * h, y[n:], x)
            copy(y[n:], v)
            for j in range(i):
                add(x, a[i, j] * h * h, k[2 * j * n : (2 * j + 1) * n], x)
            acceleration(t + times[i] * h, x, v, k[2 * i * n : (2 * i + 1) * n], args)
        add(y[:n], h, y[n:], x)
        copy(y[n:], v)
        for j in range(stages):
            add(x, b_position[j] * h * h, k[2 * j * n : (2 * j + 1) * n], x)
            add(v, b[j] * h, k[2 * j * n : (2 * j + 1) * n], v)
        return stages

    @wrap.part
    def close(t, end, w, args):  # type: ignore[no-untyped-def]
        return 0

    return Pieces(begin, take, close, _no_error(wrap), *partial_step(take, wrap))


def _no_error(wrap: Wrap) -> Kernel:
    """The error estimate of methods that have none; `solve_newton` lets them take fixed steps."""

    @wrap.part
    def error(t, y, end, w, h, rtol, atol, args):  # type: ignore[no-untyped-def]
        return 0.0, 0

    return error


def _kick(wrap: Wrap, drag: bool) -> Kernel:
    @wrap.part
    def plain(v, a, h, args):  # type: ignore[no-untyped-def]
        add(v, h, a, v)

    @wrap.part
    def damped(v, a, h, args):  # type: ignore[no-untyped-def]
        rates = args[0]
        for i in range(v.size):
            z = rates[i] * h
            share = -math.expm1(-z) / z if abs(z) > 1e-12 else 1.0
            v[i] += h * share * (a[i] - rates[i] * v[i])

    return damped if drag else plain
