"""Newton's method without a matrix: x = respond(x) for the pushes between all of a group.

Derivatives are differences along one direction, linear systems are solved in Krylov spaces (GMRES).
Knoll and Keyes, Journal of Computational Physics 193 (2004) 357-397.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from motes.linear import combine_basis, dot, orthogonalise

Vector = NDArray[np.float64]

NEWTON = 40
"""Most iterations."""

FORCING = 1e-3
"""What a linear system may be off, as a share of its right side; so much better is an iteration."""

SPACE = 200
"""Most vectors of a Krylov space: stiffness c needs some sqrt(c) of them."""

MEMORY = 50_000_000
"""Most numbers in one."""

LEAST = 1e-6
"""Share of an iteration's way below which it is not shortened further."""


def gmres(
    apply: Callable[[Vector], Vector], right: Vector, tolerance: float
) -> tuple[Vector, float]:
    """The x of a Krylov space for which apply(x) is nearest to `right`, and how far it is off.

    Both `tolerance` and what is returned are relative to the right side's length. Saad and Schultz
    1986.
    """
    length, most = norm(right), min(SPACE, right.size, max(MEMORY // max(right.size, 1), 10))
    result = np.zeros_like(right)
    if length == 0.0 or not math.isfinite(length):
        return result, 0.0 if length == 0.0 else math.inf
    basis = np.zeros((most + 1, right.size))
    triangle, turns, sides = np.zeros((most + 1, most)), np.zeros((2, most)), np.zeros(most + 1)
    basis[0], sides[0] = right / length, length
    j, left = 0, length
    while j < most:
        basis[j + 1] = apply(basis[j])
        j += 1
        left = orthogonalise(basis, j - 1, triangle, turns, sides)
        if not left > tolerance * length:
            break
    combine_basis(basis, j, triangle, sides, result)
    return result, left / length


def newton(
    respond: Callable[[Vector], Vector],
    x: Vector,
    shift: Callable[[Vector], float],
    change: Callable[[], float],
) -> float:
    """Find x = respond(x), in place; returns the last change in roundings of the states.

    `shift(v)` is the length along v over which a difference is taken. `change()` compares the
    states of the last call of `respond` with those of the last call of `change` [roundings].
    """
    found = respond(x)
    change()
    rest = found - x
    moved = math.inf
    for _ in range(NEWTON):
        size = norm(rest)

        def linear(v: Vector, start: Vector = found) -> Vector:
            step = shift(v)
            return v - (respond(x + step * v) - start) / step

        way, share = gmres(linear, rest, FORCING)[0], 1.0
        while True:
            trial = x + share * way
            later = respond(trial)
            better = later - trial
            smaller = norm(better) <= (1 - 1e-4 * share) * size
            if smaller or share < LEAST:
                break
            share /= 2
        if not smaller:  # Rounding ended it, or there is no way on.
            respond(x)
            return min(moved, change()) if math.isfinite(size) else math.inf
        x[:], found, rest = trial, later, better
        moved = change()
        if share == 1.0 and FORCING * moved <= 1.0:
            break
    return moved


def norm(x: Vector) -> float:
    """Length of a vector."""
    return math.sqrt(dot(x, x))
