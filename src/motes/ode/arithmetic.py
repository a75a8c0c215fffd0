"""Sums over the components of a state, as kernels, for all explicit solvers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.generated import executed
from motes.jit import bound, jit

Array = NDArray[np.float64]
Kernel = Any
"""A compiled function; Numba has no types that mypy could know."""


class Sum(NamedTuple):
    """w[target] = w[base] + h sum weight_j w[j], rows of a march's memory; base None: 0."""

    target: int
    base: int | None
    weights: Sequence[tuple[int, float]]


def sums(lines: Sequence[Sum], rows: int, size: int | None) -> Kernel:
    """combine(w, number, h): the sum of that number, in memory w of `rows` rows of `size` numbers.

    The numbers stand in the machine code, each sum is one pass, and zeros are left out: with
    weights as arrays the same takes twice as long. Without a size it serves states of any.
    """
    text = ["def combine(w, number, h):", f"    n = {size or f'w.size // {rows}'}"]
    for number, line in enumerate(lines):
        text += [
            f"    if number == {number}:",
            "        for i in range(n):",
            f"            w[{line.target} * n + i] = {_sum(line)}",
        ]
    return _kernel("combine", text, inline=size is not None)


def estimate(sums: Sequence[Sum], rows: int, size: int | None) -> Kernel:
    """sizes(w, h, rtol, atol): norms of one or two error estimates in one pass.

    The norm is the root mean square over atol + rtol max(|y|, |y1|); the first estimate itself goes
    to its target. With one estimate, the second norm is 0.
    """
    text = ["def sizes(w, h, rtol, atol):", f"    n = {size or f'w.size // {rows}'}"]
    text += ["    first, second = 0.0, 0.0", "    for i in range(n):"]
    text += [
        f"        e = {_sum(sums[0])}",
        f"        w[{sums[0].target} * n + i] = e",
        "        before, after = abs(w[i]), abs(w[n + i])",
        "        scale = 1.0 / (atol[i] + rtol * (before if before > after else after))",
        "        first += (e * scale) ** 2",
    ]
    if len(sums) > 1:
        text.append(f"        second += ({_sum(sums[1])} * scale) ** 2")
    text.append("    return math.sqrt(first / n), math.sqrt(second / n)")
    return _kernel("sizes", text, inline=size is not None)


def _sum(line: Sum) -> str:
    terms = [f"{float(x)!r} * w[{row} * n + i]" for row, x in line.weights if x]
    moved = f"h * ({' + '.join(terms) or '0.0'})"
    return moved if line.base is None else f"w[{line.base} * n + i] + {moved}"


def _kernel(name: str, text: list[str], *, inline: bool) -> Kernel:
    names: dict[str, Any] = {"__name__": __name__, "math": math}
    kernel = jit(executed("\n".join(text), names)[name], inline=inline)
    return kernel if inline else _remembering(kernel)


def _remembering(kernel: Kernel) -> Kernel:
    """kernel(w, ...) for calls from Python, which takes w apart only where it is another one."""
    known: list[tuple[Any, Any]] = [(None, None)]

    def call(w, *rest):  # type: ignore[no-untyped-def]
        last, run = known[0]
        if last is not w:
            run = bound(kernel, w)
            known[0] = w, run
        return run(*rest)

    return call


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
def hermite(w: Array, n: int, last: int, spare: int, h: float) -> None:
    """The interpolant's rows D, F1, F2 of `motes.tableau.Explicit`, from both ends of the step.

    `last` is the row of the slope at the end, `spare` the first of the three.
    """
    for i in range(n):
        d = w[n + i] - w[i]
        w[spare * n + i] = d
        w[(spare + 1) * n + i] = h * w[2 * n + i] - d
        w[(spare + 2) * n + i] = 2.0 * d - h * (w[2 * n + i] + w[last * n + i])


@jit
def interpolate(w: Array, n: int, spare: int, count: int, share: float, out: Array) -> None:
    """The interpolant at a share of the step, from its `count` rows."""
    rest = 1.0 - share
    for i in range(n):
        out[i] = w[(spare + count - 1) * n + i]
    for m in range(count - 2, -1, -1):
        factor = rest if m % 2 == 0 else share
        for i in range(n):
            out[i] = w[(spare + m) * n + i] + factor * out[i]
    for i in range(n):
        out[i] = w[i] + share * out[i]
