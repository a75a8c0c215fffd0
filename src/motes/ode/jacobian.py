"""df/dy of a system, and solves with I - h A x df/dy: dense, coloured, or matrix-free."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motes import linear
from motes.jit import jit
from motes.linear import KRYLOV
from motes.ode.arithmetic import Array, Kernel, add, copy
from motes.ode.march import FIRST_SLOPE
from motes.ode.right_hand_side import PLAIN, Wrap

SMALL_SYSTEM = 48
"""Up to this size, our own kernels solve a plain function's systems faster than LAPACK's calls."""

ERROR, ATOL, RTOL, TIME, KNOWN, BASE, STATE, VALUE, RESIDUAL = range(9)
"""Spare rows of an implicit method: the error estimate; tolerances of Newton's method; time of the
Jacobian and whether there is one (the first number of a row); the known part of a stage, its state,
f there; residuals, one row for each stage that is solved at once. The Jacobian and what solves
with it follow."""


@dataclass(frozen=True)
class Newton:
    """How implicit methods solve their equations.

    `jacobian(t, y, *args)` gives df/dy, (n, n), of the flattened state. Without it, differences:
    `sparsity`, (n, n), tells which entries may differ from 0, and columns that share no row are
    differenced together (Curtis, Powell and Reid, IMA Journal of Applied Mathematics 13 (1974)).
    `solver="krylov"` never forms a matrix: GMRES with directional differences, for large systems.
    """

    jacobian: Callable[..., ArrayLike] | None = None
    sparsity: ArrayLike | None = None
    solver: Literal["dense", "krylov"] = "dense"
    iterations: int = 12
    """Newton iterations after which a step counts as having no solution."""

    def key(self, n: int) -> NewtonKey:
        """The same as something that a cache can find."""
        pattern = self.sparsity
        if pattern is not None:
            pattern = np.asarray(pattern, bool)
            if pattern.shape != (n, n):
                raise ValueError(f"sparsity must be ({n}, {n}), not {pattern.shape}")
        packed = None if pattern is None else pattern.tobytes()
        return NewtonKey(self.jacobian, packed, self.solver, self.iterations)


class NewtonKey(NamedTuple):
    """A `Newton` with its pattern as bytes."""

    jacobian: Callable[..., ArrayLike] | None
    sparsity: bytes | None
    solver: Literal["dense", "krylov"]
    iterations: int

    def newton(self, n: int) -> Newton:
        """The options again, for a system of n components."""
        pattern = self.sparsity
        whole = None if pattern is None else np.frombuffer(pattern, bool).reshape(n, n)
        return Newton(self.jacobian, whole, self.solver, self.iterations)


def colours(sparsity: ArrayLike, n: int) -> list[NDArray[np.int64]]:
    """Groups of columns of an (n, n) pattern, in none of which two have an entry in one row."""
    pattern = np.asarray(sparsity, bool)
    groups: list[list[int]] = []
    filled: list[NDArray[np.bool_]] = []
    for column in range(n):
        rows = pattern[:, column]
        for group, taken in zip(groups, filled, strict=True):
            if not (taken & rows).any():
                group.append(column)
                taken |= rows
                break
        else:
            groups.append([column])
            filled.append(rows.copy())
    return [np.array(group) for group in groups]


class Linear(NamedTuple):
    """Solves with I - h A x df/dy at the start of a step, with A of (m, m).

    factor(w, h): the matrix for a step of h, unless it is known.
    solve(t, y, w, args) -> evaluations: replaces the first m rows of residuals by the solution.
    rows: spare rows that all of it takes.
    """

    factor: Kernel
    solve: Kernel
    rows: int


class Place(NamedTuple):
    """Rows of the memory: the first spare one, the Jacobian's first, and the first of a solver."""

    spare: int
    jacobian: int
    solver: int


def linearisation(slope: Kernel, newton: Newton, n: int, place: Place, wrap: Wrap) -> Kernel:
    """linearise(t, y, w, args) -> evaluations: df/dy into its rows, unless it is known there."""
    spare = place.spare
    matrix_free = newton.solver == "krylov"
    if newton.jacobian:
        derive = _given(newton.jacobian, n, place.jacobian, wrap)
    else:
        derive = _differences(slope, newton.sparsity, n, place, wrap)

    @wrap.loop
    def linearise(t, y, w, args):  # type: ignore[no-untyped-def]
        if matrix_free or (w[(spare + KNOWN) * n] == 1.0 and w[(spare + TIME) * n] == t):
            return 0
        w[(spare + KNOWN) * n], w[(spare + TIME) * n] = 1.0, t
        return derive(t, y, w, args)

    return linearise


def solver(slope: Kernel, newton: Newton, n: int, a: Array, place: Place, wrap: Wrap) -> Linear:
    """As the user asks: by a matrix, or matrix-free."""
    if newton.solver == "krylov":
        return _krylov(slope, n, a, place, wrap)
    return _dense(n, a, place, wrap)


def _dense(n: int, a: Array, place: Place, wrap: Wrap) -> Linear:
    m = len(a)
    size, spare, jacobian, head = m * n, *place
    matrix, pivot = head + 2, head + 2 + m * size
    lapack = wrap is PLAIN and size > SMALL_SYSTEM

    # A plain function's large system goes to LAPACK.
    factorise = linear.inverted if lapack else linear.factorise
    substitute = linear.multiplied if lapack else linear.substitute

    @wrap.loop
    def factor(w, h):  # type: ignore[no-untyped-def]
        t = w[(spare + TIME) * n]
        if w[head * n] != h or w[(head + 1) * n] != t:
            w[head * n], w[(head + 1) * n] = h, t
            whole = w[matrix * n : pivot * n]
            linear.implicit_matrix(w[jacobian * n : (jacobian + n) * n], a, h, whole)
            factorise(whole, w[pivot * n : (pivot + m) * n])

    @wrap.loop
    def solve(t, y, w, args):  # type: ignore[no-untyped-def]
        b = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + m) * n]
        substitute(w[matrix * n : pivot * n], w[pivot * n : (pivot + m) * n], b)
        return 0

    return Linear(factor, solve, 2 + m * size + m)


def _given(jacobian: Callable[..., ArrayLike], n: int, first: int, wrap: Wrap) -> Kernel:
    if wrap is PLAIN:

        def plain(t, y, w, args):  # type: ignore[no-untyped-def]
            value = np.asarray(jacobian(t, y, *args), float)
            w[first * n : (first + n) * n] = value.reshape(-1)
            return 0

        return plain

    @wrap.part
    def call(t, y, w, args):  # type: ignore[no-untyped-def]
        value: Any = jacobian(t, y, *args)
        for i in range(n):
            for j in range(n):
                w[(first + i) * n + j] = value[i][j]
        return 0

    return call


def _differences(
    slope: Kernel, sparsity: ArrayLike | None, n: int, place: Place, wrap: Wrap
) -> Kernel:
    spare, first, _ = place
    groups = [np.array([c]) for c in range(n)] if sparsity is None else colours(sparsity, n)
    pattern = np.ones((1, 1), bool) if sparsity is None else np.asarray(sparsity, bool)
    colour = np.empty(n, np.int64)
    for number, group in enumerate(groups):
        colour[group] = number
    count = len(groups)
    dense = sparsity is None

    @jit
    def shift(y, number, state):  # type: ignore[no-untyped-def]
        for c in range(n):
            state[c] = y[c]
            if colour[c] == number:
                state[c] += 1.4901161193847656e-8 * max(abs(y[c]), 1e-5)

    @jit
    def columns(w, y, number, state, value):  # type: ignore[no-untyped-def]
        for c in range(n):
            if colour[c] == number:
                moved = state[c] - y[c]
                for r in range(n):
                    change = value[r] - w[FIRST_SLOPE * n + r]
                    entry = change / moved if dense or pattern[r, c] else 0.0
                    w[(first + r) * n + c] = entry

    @wrap.loop
    def derive(t, y, w, args):  # type: ignore[no-untyped-def]
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        for number in range(count):
            shift(y, number, state)
            slope(t, state, w, spare + VALUE, args)
            columns(w, y, number, state, value)
        return count

    return derive


def _krylov(slope: Kernel, n: int, a: Array, place: Place, wrap: Wrap) -> Linear:
    """GMRES, with the derivative along a vector as a difference."""
    m = len(a)
    size, spare, _, head = m * n, *place
    most = min(KRYLOV, size)

    @wrap.loop
    def factor(w, h):  # type: ignore[no-untyped-def]
        w[head * n] = h

    @wrap.part
    def along(t, y, v, w, args):  # type: ignore[no-untyped-def]
        """df/dy v into the row of values."""
        length = math.sqrt(linear.dot(v, v))
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        if length == 0.0:
            copy(v, value)
            return 0
        step = math.sqrt(2.220446049250313e-16 * (1.0 + math.sqrt(linear.dot(y, y)))) / length
        state = w[(spare + STATE) * n : (spare + STATE + 1) * n]
        copy(y, state)
        add(state, step, v, state)
        slope(t, state, w, spare + VALUE, args)
        add(value, -1.0, w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], value)
        linear.scale(value, 1.0 / step, value)
        return 1

    @wrap.loop
    def solve(t, y, w, args):  # type: ignore[no-untyped-def]
        b = w[(spare + RESIDUAL) * n : (spare + RESIDUAL + m) * n]
        basis = w[(head + 1) * n : (head + 1 + m * (most + 1)) * n].reshape(most + 1, size)
        h = w[head * n]
        length = math.sqrt(linear.dot(b, b))
        if length == 0.0 or not length < math.inf:
            return 0
        linear.scale(b, 1.0 / length, basis[0])
        triangle, turns, right = np.zeros((most + 1, most)), np.zeros((2, most)), np.zeros(most + 1)
        right[0] = length
        value = w[(spare + VALUE) * n : (spare + VALUE + 1) * n]
        evaluations, j = 0, 0
        while j < most:
            old, new = basis[j], basis[j + 1]
            copy(old, new)
            for i in range(m):
                evaluations += along(t, y, old[i * n : (i + 1) * n], w, args)
                for r in range(m):
                    part = new[r * n : (r + 1) * n]
                    add(part, -h * a[r, i], value, part)
            j += 1
            if linear.orthogonalise(basis, j - 1, triangle, turns, right) <= 1e-6 * length:
                break
        linear.combine_basis(basis, j, triangle, right, b)
        return evaluations

    return Linear(factor, solve, 1 + m * (most + 1))
