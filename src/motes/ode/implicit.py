"""Implicit methods as pieces of a march, in NumPy: their time goes into f and linear algebra."""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.ode.arithmetic import Array, hermite, interpolate, norm
from motes.ode.jacobian import Linearisation
from motes.ode.march import Pieces, partial_step
from motes.ode.right_hand_side import PLAIN
from motes.tableau import BackwardDifference, Implicit, Rosenbrock

EXACTLY = 1e-13
"""Newton's tolerance where no other is given: what rounding leaves."""


class Solver:
    """Newton's method for the stages of a step, with one matrix for all of its iterations.

    The equations of stages i are k_i = f(t + c_i h, y_i + h sum_j a_ij k_j), y_i known, and the
    change h dk of the states must fall below a share of the tolerance (Hairer and Wanner, Solving
    Ordinary Differential Equations II, section IV.8).
    """

    def __init__(self, near: Linearisation, rtol: float, atol: Array) -> None:
        self.near = near
        self.rtol, self.atol = (0.01 * rtol, 0.01 * atol) if rtol else (EXACTLY, atol * EXACTLY)
        self.exact = not rtol

    def slopes(
        self, times: Array, known: Array, a: Array, h: float, guess: Array
    ) -> tuple[Array, bool]:
        """Slopes of the stages, and whether the iteration converged."""
        k = guess.copy()
        solve = self.near.solver(a, h)
        last = np.inf
        for _ in range(self.near.newton.iterations):
            states = known + h * a @ k
            values = np.stack([self.near.f(t, y) for t, y in zip(times, states, strict=True)])
            self.near.evaluations += len(times)
            if not np.isfinite(values).all():
                return k, False
            change = solve(values - k)
            k += change
            moved = h * a @ change
            size = max(
                float(norm(m, s, s, self.rtol, self.atol))
                for m, s in zip(moved, states, strict=True)
            )
            if size <= 1:
                return k, True
            if size > 2 * last or (size > 0.5 * last and self.exact and size < 1e5):
                # Rounding stops an exact iteration before its tolerance: that is as good.
                return k, self.exact and size < 1e5
            last = size
        return k, self.exact and last < 1e5


def runge_kutta(table: Implicit, solver: Solver) -> Pieces:
    """An implicit Runge-Kutta method: stages one by one, or all together where they depend so."""
    a, b, c = np.array(table.a, float), np.array(table.b, float), np.array(table.c, float)
    known = [i for i in range(table.stages) if not a[i, i:].any()]
    rest = [i for i in range(table.stages) if i not in known]
    groups = [[i] for i in rest] if table.diagonal else [rest]
    weights = b - np.array(table.b_low, float) if table.b_low is not None else 0 * b
    # The filter that keeps the estimate small where the problem is stiff: Hairer and Wanner II,
    # eq. IV.8.19.
    filter_share = a[-1, -1] if table.diagonal or table.b_low is None else table.b_low[0]
    near = solver.near

    def begin(t: float, y: Array, k: Array, args: Any) -> int:
        k[0] = near.f(t, y)
        return 1

    def take(t: float, y: Array, k: Array, end: Array, h: float, args: Any) -> int:
        near.evaluations = 0
        near.move(t, y)
        start = near.value
        stages = np.zeros((table.stages, y.size))
        for i in known:
            stages[i] = start if i == 0 else near.f(t + c[i] * h, y + h * a[i] @ stages)
        for group in groups:
            base = y + h * a[group] @ stages
            guess = np.tile(start if group[0] <= 1 else stages[group[0] - 1], (len(group), 1))
            block = a[np.ix_(group, group)]
            stages[group], found = solver.slopes(t + c[group] * h, base, block, h, guess)
            if not found:
                return -near.evaluations
        end[:] = y + h * b @ stages
        k[1 : 1 + table.stages] = stages
        return near.evaluations

    def close(t: float, end: Array, k: Array, args: Any) -> int:
        k[-1] = near.f(t, end)
        return 1

    def error(
        t: float, y: Array, end: Array, k: Array, h: float, rows: Array, rtol: float, atol: Array
    ) -> float:
        raw = h * weights @ k[1 : 1 + table.stages]
        rows[0] = near.solver(np.array([[filter_share]]), h)(raw[None])[0]
        return float(norm(rows[0], y, end, rtol, atol))

    return Pieces(begin, take, close, error, *partial_step(take, PLAIN))


def rosenbrock(table: Rosenbrock, solver: Solver) -> Pieces:
    """A Rosenbrock method: one linear solve for each stage, no iteration."""
    near = solver.near
    gamma = table.gamma
    weights = np.subtract(table.b, table.b_low)

    def begin(t: float, y: Array, k: Array, args: Any) -> int:
        k[0] = near.f(t, y)
        return 1

    def take(t: float, y: Array, k: Array, end: Array, h: float, args: Any) -> int:
        near.evaluations = 0
        near.move(t, y)
        # 1 / (gamma h) - J is (I - gamma h J) / (gamma h).
        solve = near.solver(np.array([[gamma]]), h)
        moment = 1e-8 * max(abs(t), abs(h))
        drift = (near.f(t + moment, y) - near.value) / moment
        near.evaluations += 1
        u = np.zeros((table.stages, y.size))
        for i, (row, d) in enumerate(zip(table.a, table.d, strict=True)):
            value = near.value
            if i:
                value = near.f(t + table.c[i] * h, y + np.array(row) @ u[:i])
                near.evaluations += 1
                value = value + np.array(d) @ u[:i] / h
            u[i] = gamma * h * solve((value + h * table.g[i] * drift)[None])[0]
        end[:] = y + np.array(table.b) @ u
        k[1 : 1 + table.stages] = u
        return near.evaluations

    def close(t: float, end: Array, k: Array, args: Any) -> int:
        k[-1] = near.f(t, end)
        return 1

    def error(
        t: float, y: Array, end: Array, k: Array, h: float, rows: Array, rtol: float, atol: Array
    ) -> float:
        rows[0] = weights @ k[1 : 1 + table.stages]
        return float(norm(rows[0], y, end, rtol, atol))

    return Pieces(begin, take, close, error, *partial_step(take, PLAIN))


def backward_difference(table: BackwardDifference, solver: Solver) -> Pieces:
    """The second formula, for steps that may differ; without a past, a backward Euler step.

    With w = h / h_before: y1 = ((1 + w)^2 y0 - w^2 y_before + (1 + w) h f(y1)) / (1 + 2 w).
    Slopes k hold the slope at the start, the state before, its distance, and the slope at the end.
    Dense output is the cubic through both ends.
    """
    near = solver.near

    def begin(t: float, y: Array, k: Array, args: Any) -> int:
        k[0] = near.f(t, y)
        return 1

    def take(t: float, y: Array, k: Array, end: Array, h: float, args: Any) -> int:
        near.evaluations = 0
        near.move(t, y)
        w = h / k[2, 0] if k[2, 0] else 0.0
        base = ((1 + w) ** 2 * y - w * w * k[1]) / (1 + 2 * w)
        share = np.array([[(1 + w) / (1 + 2 * w)]])
        slopes, found = solver.slopes(np.array([t + h]), base[None], share, h, near.value[None])
        if not found:
            return -near.evaluations
        end[:] = base + h * share[0, 0] * slopes[0]
        k[1], k[2, 0] = y, h
        return near.evaluations

    def close(t: float, end: Array, k: Array, args: Any) -> int:
        k[-1] = near.f(t, end)
        return 1

    def error(*_: Any) -> float:
        return 0.0

    def prepare(t: float, y: Array, end: Array, k: Array, h: float, rows: Array, args: Any) -> int:
        hermite(y, end, k, h, rows)
        return 0

    def inside(
        share: float, t: float, y: Array, k: Array, h: float, rows: Array, out: Array, args: Any
    ) -> int:
        interpolate(y, rows, share, out)
        return 0

    return Pieces(begin, take, close, error, prepare, inside)


def pieces(
    table: Implicit | Rosenbrock | BackwardDifference, solver: Solver
) -> tuple[Pieces, tuple[int, int]]:
    """The method, its number of slopes, and of rows for dense output."""
    if isinstance(table, BackwardDifference):
        return backward_difference(table, solver), (4, 3)
    slopes = table.stages + 2
    if isinstance(table, Rosenbrock):
        return rosenbrock(table, solver), (slopes, slopes)
    return runge_kutta(table, solver), (slopes, slopes)
