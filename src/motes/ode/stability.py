"""What a table says about itself: stability on the axes, order, error constant, at a glance."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes import rooted_trees
from motes.integrate import methods as tables
from motes.tableau import (
    BackwardDifference,
    Explicit,
    Implicit,
    Nystrom,
    Rosenbrock,
    Splitting,
    Table,
)

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.float64]
Growth = Callable[[Complex], Real]

FAR = 1e4
"""A method that is stable to here on an axis counts as stable for ever."""


@dataclass(frozen=True)
class MethodFacts:
    """One method, as a table of methods shows it."""

    name: str
    order: int
    stages: int
    implicit: bool
    symplectic: bool
    embedded: int | None
    """Order of the embedded method that estimates the error, if there is one."""

    real: float
    """Largest h k for which x' = -k x does not grow."""

    imaginary: float
    """Largest h w for which x'' = -w^2 x does not grow."""


def methods() -> tuple[MethodFacts, ...]:
    """All methods: name, order, stages, implicit, symplectic, embedded, stability on the axes."""
    return tuple(facts(name) for name in tables())


def facts(name: str) -> MethodFacts:
    """One method's entry in the table."""
    table = tables()[name]
    low = table.low_order if getattr(table, "b_low", None) is not None else None  # type: ignore[union-attr]
    real = _reach(table, -1.0) if not _second_order(table) else math.nan
    imaginary = _reach(table, 1.0j)
    return MethodFacts(
        name, table.order, table.stages, table.implicit, table.symplectic, low, real, imaginary
    )


def growth(table: Table) -> Growth:
    """Largest |y1 / y0| on y' = z y / h, of any z; for second-order methods on x'' = (z / h)^2 x.

    Runge-Kutta: |1 + z b (1 - z A)^-1 1|; a formula with a past or a splitting: the largest modulus
    of an eigenvalue of one step.
    """
    if isinstance(table, Explicit | Implicit):
        a = np.zeros((len(table.b), len(table.b)))
        for i, row in enumerate(table.a):
            a[i, : len(row)] = row
        return _rational(a, np.array(table.b))
    if isinstance(table, Rosenbrock):
        # On a linear problem a Rosenbrock method is the Runge-Kutta method alpha + Gamma.
        inverse = np.diag([1 / table.gamma] * table.stages)
        a = np.zeros_like(inverse)
        for i, (row, d) in enumerate(zip(table.a, table.d, strict=True)):
            a[i, :i] = row
            inverse[i, :i] -= d
        lower = np.linalg.inv(inverse)
        return _rational(a @ lower + lower, np.array(table.b) @ lower)
    if isinstance(table, BackwardDifference):
        return lambda z: _roots(z, table.a)
    return lambda z: _oscillator(z, table)


def _rational(a: NDArray[np.float64], b: NDArray[np.float64]) -> Growth:
    def modulus(z: Complex) -> Real:
        z = np.asarray(z, complex)
        whole = np.eye(len(b)) - z[..., None, None] * a
        ones = np.ones((*z.shape, len(b), 1), complex)
        stages = np.linalg.solve(whole, ones)[..., 0]
        result: Real = np.abs(1 + z * (stages @ b))
        return result

    return modulus


def _roots(z: Complex, a: tuple[float, ...]) -> Real:
    flat = np.asarray(z, complex).reshape(-1)
    result = [np.abs(np.roots([a[0] - x, *a[1:]])).max() for x in flat]
    return np.array(result).reshape(np.shape(z))


def _oscillator(z: Complex, table: Table) -> Real:
    """Spectral radius of one step of x'' = z^2 x with h = 1."""
    flat = np.asarray(z, complex).reshape(-1)
    square = flat**2
    x, v = np.eye(2, dtype=complex)[:, :, None] * np.ones_like(flat)
    if isinstance(table, Nystrom):
        slopes: list[Complex] = []
        for c, row in zip(table.c, table.a, strict=True):
            state = x + c * v
            for weight, k in zip(row, slopes, strict=True):
                state = state + weight * k
            slopes.append(square * state)
        x = x + v + sum(w * k for w, k in zip(table.b_position, slopes, strict=True))
        v = v + sum(w * k for w, k in zip(table.b, slopes, strict=True))
    else:
        for kick, drift in zip(table.kicks, (*table.drifts, 0.0), strict=True):  # type: ignore[union-attr]
            v = v + kick * square * x
            x = x + drift * v
    trace, determinant = x[0] + v[1], x[0] * v[1] - x[1] * v[0]
    root = np.sqrt(trace**2 / 4 - determinant)
    result: Real = np.maximum(np.abs(trace / 2 + root), np.abs(trace / 2 - root))
    return result.reshape(np.shape(z))


def _second_order(table: Table) -> bool:
    return not isinstance(table, Explicit | Implicit | Rosenbrock | BackwardDifference)


def _reach(table: Table, direction: complex) -> float:
    """How far from 0 along a ray no solution grows by more than rounding."""
    modulus = growth(table)

    def stable(z: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(modulus(direction * z) <= 1 + 1e-9)

    coarse = np.arange(0.01, 30, 0.01)
    if table.implicit:
        coarse = np.append(coarse, [100.0, 1e3, FAR])
    bad = np.flatnonzero(~stable(coarse))
    if not bad.size:
        return math.inf
    low, high = (0.0, coarse[bad[0]]) if bad[0] == 0 else coarse[bad[0] - 1 : bad[0] + 1]
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if stable(np.array([middle]))[0] else (low, middle)
    return float(low) if low > 0.011 else 0.0


def error_constant(table: Table) -> float:
    """Root of the sum of squared errors of the next order's conditions.

    sqrt(sum over trees of p + 1 vertices of (b phi(t) - 1 / density(t))^2), unweighted; for
    second-order methods over the conditions of position and velocity; for a formula with a past,
    sum a_j (-j)^(p + 1) / (p + 1)!, with the slope's weight 1. Hairer, Norsett and Wanner I,
    sections II.2, II.14, III.2.
    """
    order = table.order
    if isinstance(table, BackwardDifference):
        terms = [a * (-j) ** (order + 1) for j, a in enumerate(table.a)]
        return float(abs(sum(terms)) / math.factorial(order + 1))
    trees = list(rooted_trees.trees(order + 1))
    defects: list[float] = []
    if isinstance(table, Nystrom | Splitting):
        b_position, b_velocity = table.ends
        for tree in filter(rooted_trees.special, trees):
            defects.append(_defect(b_velocity, table.weight(tree), rooted_trees.density(tree)))
        for tree in filter(rooted_trees.special, rooted_trees.trees(order)):
            share = (order + 1) * rooted_trees.density(tree)
            defects.append(_defect(b_position, table.weight(tree), share))
        return math.hypot(*defects)
    b = table.weights if isinstance(table, Rosenbrock) else table.b
    weight = table.weight if isinstance(table, Rosenbrock) else rooted_trees.weight(table.a)
    return math.hypot(*(_defect(b, weight(tree), rooted_trees.density(tree)) for tree in trees))


def _defect(b: Sequence[float], phi: Sequence[float], density: float) -> float:
    """sum b phi - 1 / density."""
    return sum(x * y for x, y in zip(b, phi, strict=True)) - 1 / density
