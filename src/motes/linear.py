"""Linear algebra of implicit methods as kernels: small dense systems, and Krylov spaces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import EXACT, jit

Array = NDArray[Any]

KRYLOV = 60
"""Most vectors of a Krylov basis."""


@jit
def implicit_matrix(jacobian: Array, a: Array, h: float, out: Array) -> None:
    """out = I - h a x jacobian (Kronecker), for a of (m, m); both matrices lie in one row each."""
    m = a.shape[0]
    n = int(math.sqrt(jacobian.size) + 0.5)
    for i in range(m):
        for j in range(m):
            share = h * a[i, j]
            for r in range(n):
                row = (i * n + r) * m * n + j * n
                for c in range(n):
                    out[row + c] = -share * jacobian[r * n + c]
    for i in range(m * n):
        out[i * (m * n + 1)] += 1.0


@jit(flags=EXACT)
def factorise(matrix: Array, pivots: Array) -> None:
    """Replace an (n, n) matrix by its triangular factors, with row pivots.

    Golub and Van Loan, Matrix Computations, algorithm 3.4.1.
    """
    n = pivots.size
    for k in range(n):
        best, place = abs(matrix[k * n + k]), k
        for i in range(k + 1, n):
            if abs(matrix[i * n + k]) > best:
                best, place = abs(matrix[i * n + k]), i
        pivots[k] = place
        if place != k:
            for j in range(n):
                kept = matrix[k * n + j]
                matrix[k * n + j] = matrix[place * n + j]
                matrix[place * n + j] = kept
        inverse = 1.0 / matrix[k * n + k]
        upper = matrix[k * n + k + 1 : k * n + n]
        for i in range(k + 1, n):
            share = matrix[i * n + k] * inverse
            matrix[i * n + k] = share
            if share != 0.0:
                row = matrix[i * n + k + 1 : i * n + n]
                for j in range(row.size):
                    row[j] -= share * upper[j]


@jit(flags=EXACT)
def substitute(matrix: Array, pivots: Array, b: Array) -> None:
    """Solve a factorised system in place."""
    n = pivots.size
    for k in range(n):
        place = int(pivots[k])
        kept = b[k]
        b[k] = b[place]
        b[place] = kept
    for i in range(n):
        total = b[i]
        for j in range(i):
            total -= matrix[i * n + j] * b[j]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= matrix[i * n + j] * b[j]
        b[i] = total / matrix[i * n + i]


@jit
def dot(x: Array, y: Array) -> float:
    """x . y"""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@jit
def scale(x: Array, factor: float, out: Array) -> None:
    """out = factor x"""
    for i in range(x.size):
        out[i] = factor * x[i]


@jit
def orthogonalise(basis: Array, j: int, triangle: Array, turns: Array, right: Array) -> float:
    """Make vector j + 1 of a Krylov basis orthogonal to those before it; gives the new residual.

    The least squares problem is kept triangular by rotations `turns`; `right` is its right side.
    Saad and Schultz, SIAM Journal on Scientific and Statistical Computing 7 (1986) 856-869.
    """
    n = basis.shape[1]
    new = basis[j + 1]
    for i in range(j + 2):
        triangle[i, j] = 0.0
    for _ in range(2):  # Twice is enough (Kahan): the basis stays orthogonal.
        for i in range(j + 1):
            share = dot(basis[i], new)
            triangle[i, j] += share
            for r in range(n):
                new[r] -= share * basis[i, r]
    size = math.sqrt(dot(new, new))
    if size > 0.0:
        scale(new, 1.0 / size, new)
    for i in range(j):
        upper, lower = triangle[i, j], triangle[i + 1, j]
        triangle[i, j] = turns[0, i] * upper + turns[1, i] * lower
        triangle[i + 1, j] = turns[0, i] * lower - turns[1, i] * upper
    upper = triangle[j, j]
    length = math.sqrt(upper * upper + size * size)
    turns[0, j], turns[1, j] = (upper / length, size / length) if length > 0.0 else (1.0, 0.0)
    triangle[j, j] = length
    right[j + 1] = -turns[1, j] * right[j]
    right[j] *= turns[0, j]
    return abs(right[j + 1]) if size > 0.0 else 0.0


@jit
def combine_basis(basis: Array, count: int, triangle: Array, right: Array, out: Array) -> None:
    """out = basis x of the least squares problem's solution x."""
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            right[i] -= triangle[i, j] * right[j]
        right[i] /= triangle[i, i]
    for r in range(out.size):
        out[r] = 0.0
    for i in range(count):
        for r in range(out.size):
            out[r] += right[i] * basis[i, r]


def inverted(matrix: Array, pivots: Array) -> None:
    """`factorise` for large systems of plain functions: the inverse, by LAPACK."""
    size = pivots.size
    try:
        matrix[:] = np.linalg.inv(matrix.reshape(size, size)).reshape(-1)
    except np.linalg.LinAlgError:
        matrix[:] = math.nan


def multiplied(matrix: Array, pivots: Array, b: Array) -> None:
    """`substitute` for an inverse."""
    b[:] = matrix.reshape(b.size, b.size) @ b
