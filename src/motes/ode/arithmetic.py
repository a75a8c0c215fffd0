"""Sums over the components of a state, as kernels, for all explicit solvers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import jit

Array = NDArray[np.float64]
Kernel = Any
"""A compiled function; Numba has no types that mypy could know."""


def combination(rows: Sequence[Sequence[float]]) -> Kernel:
    """combine(row, y, k, h, out): out = y + h sum_j rows[row][j] k[j].

    The numbers stand in the machine code, each sum is one pass, and zeros are left out: with rows
    as arrays the same takes twice as long.
    """
    lines = ["def combine(row, y, k, h, out):", "    pass"]
    for number, row in enumerate(rows):
        terms = [f"{float(weight)!r} * k[{j}, i]" for j, weight in enumerate(row) if weight]
        if terms:
            lines += [
                f"    if row == {number}:",
                "        for i in range(out.size):",
                f"            out[i] = y[i] + h * ({' + '.join(terms)})",
            ]
    names: dict[str, Any] = {"__name__": __name__}
    exec("\n".join(lines), names)
    return jit(names["combine"])


@jit
def copy(x: Array, out: Array) -> None:
    """out = x. Loops like this take Numba a tenth of the time to compile of `out[:] = x`."""
    for i in range(x.size):
        out[i] = x[i]


@jit
def add(x: Array, h: float, v: Array, out: Array) -> None:
    """out = x + h v."""
    for i in range(x.size):
        out[i] = x[i] + h * v[i]


@jit
def clear(out: Array) -> None:
    """out = 0."""
    for i in range(out.size):
        out[i] = 0.0


@jit
def norm(error: Array, y: Array, end: Array, rtol: float, atol: Array) -> float:
    """Root mean square of an error over atol + rtol max(|y|, |y1|)."""
    total = 0.0
    for i in range(y.size):
        total += (error[i] / (atol[i] + rtol * max(abs(y[i]), abs(end[i])))) ** 2
    return math.sqrt(total / y.size)


@jit
def worst(error: Array, y: Array, end: Array, rtol: float, atol: Array) -> int:
    """Component whose estimated error is largest against its tolerance; the first that is NaN."""
    found, largest = 0, -1.0
    for i in range(y.size):
        ratio = abs(error[i]) / (atol[i] + rtol * max(abs(y[i]), abs(end[i])))
        if not ratio < math.inf:
            return i
        if ratio > largest:
            found, largest = i, ratio
    return found


@jit
def first_infinite(y: Array) -> int:
    """The first component that is infinite or NaN, or -1."""
    for i in range(y.size):
        if not abs(y[i]) < math.inf:
            return i
    return -1


@jit
def hermite(y: Array, end: Array, k: Array, h: float, rows: Array) -> None:
    """The interpolant's rows D, F1, F2 of `motes.tableau.Explicit`, from both ends."""
    last = k.shape[0] - 1
    for i in range(y.size):
        d = end[i] - y[i]
        rows[0, i] = d
        rows[1, i] = h * k[0, i] - d
        rows[2, i] = 2.0 * d - h * (k[0, i] + k[last, i])


@jit
def interpolate(y: Array, rows: Array, share: float, out: Array) -> None:
    """The interpolant at a share of the step, from its rows."""
    rest = 1.0 - share
    top = rows.shape[0] - 1
    for i in range(y.size):
        out[i] = rows[top, i]
    for m in range(top - 1, -1, -1):
        factor = rest if m % 2 == 0 else share
        for i in range(y.size):
            out[i] = rows[m, i] + factor * out[i]
    for i in range(y.size):
        out[i] = y[i] + share * out[i]
