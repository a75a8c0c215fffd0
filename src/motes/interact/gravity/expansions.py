"""Cartesian expansions of a potential: which terms there are, and which meet which.

A cell's sources at places s from its center have the moments M_b = sum m (-s)^b / b!, b = (i, j, k)
with i + j + k <= p. At y from the center of another cell, R away, they make the potential
sum_a L_a y^a / a! with L_a = sum_b M_b D_{a+b}, |a| + |b| <= p, D_t the t-th partial derivative of
1 / sqrt(x^2 + e^2) at R. Source: Dehnen, Computational Astrophysics and Cosmology 1 (2014) 1,
section 2.

Where e = 0 the potential is harmonic, d2/dz2 = -d2/dx2 - d2/dy2, and terms with k >= 2 follow from
those with k < 2: (p + 1)^2 numbers instead of (p + 1)(p + 2)(p + 3)/6. The tables here say so; the
kernels that read them are the same for both, and for every order.
"""

from __future__ import annotations

from functools import cache
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Index = tuple[int, int, int]

GROUP = 4
"""Terms of a local expansion that are summed together."""


class Tables(NamedTuple):
    """The terms of one order as arrays; "row" is a term's number in one of three lists.

    The lists, each by rising degree: `basis`, the terms that are kept; `all`, with k unrestricted;
    `slopes`, the derivatives D that are needed, and after them a zero.
    """

    degree: NDArray[np.int32]
    """(basis,) degree of each term, padded to a multiple of GROUP."""
    monomial: NDArray[np.int32]
    """(all, 2): y^a / a! is row [a, 1] times coordinate [a, 0] times `factor`."""
    factor: NDArray[Any]
    """(all,)"""
    kept: NDArray[np.int32]
    """(basis,) row in all."""
    trace: NDArray[np.int32]
    """(steps, 3) rows (t, u, v) in all with D_t = -D_u - D_v; t before u and v."""
    slope_first: NDArray[np.int32]
    """(slopes + 1,) where the recursion of a derivative begins."""
    slope_terms: NDArray[np.int32]
    """(terms, 2) row in slopes, and which of x, y, z, 1 multiplies it."""
    slope_factors: NDArray[Any]
    """(terms,)"""
    meets: NDArray[np.int32]
    """(basis / GROUP,) number of moments that a group of local terms meets."""
    meeting: NDArray[np.int16]
    """(sum of meets, GROUP) row in slopes."""
    up_first: NDArray[np.int32]
    """(all + 1,) where the sum of a shifted moment begins."""
    up: NDArray[np.int16]
    """(terms, 2) rows of the moment, in basis, and of the monomial, in all."""
    down_first: NDArray[np.int32]
    """(basis + 1,) where the sum of a shifted local term begins."""
    down: NDArray[np.int16]
    """(terms, 2) rows of the local term and of the monomial, both in all."""
    next: NDArray[np.int32]
    """(3, all of degree below p) row in all of a term's derivative along x, y, z."""


@cache
def tables(order: int, harmonic: bool, real: type) -> Tables:
    """The terms of expansions of one order, with numbers of type `real`.

    The derivatives come from n D_t = sum_i t_i (-(2n - 1) x_i D_{t - e_i}
    - (n - 1) (t_i - 1) D_{t - 2 e_i}), n = |t|, with lengths in units of sqrt(R^2 + e^2).
    """
    whole = _indices(order, order)
    basis = _indices(order, 1) if harmonic else whole
    slopes = _indices(order, 2) if harmonic else whole
    in_whole, in_basis, in_slopes = (
        {t: k for k, t in enumerate(s)} for s in (whole, basis, slopes)
    )
    padded = basis + [basis[-1]] * (-len(basis) % GROUP)

    recursions = [_recursion(t, harmonic) for t in slopes]
    terms = [(in_slopes[t], axis, c) for r in recursions for t, axis, c in r]
    meets, meeting = [], []
    for first in range(0, len(padded), GROUP):
        group = padded[first : first + GROUP]
        partners = [b for b in basis if sum(b) + sum(group[0]) <= order]
        meets.append(len(partners))
        sums = [[_plus(a, b) for a in group] for b in partners]
        meeting += [[in_slopes.get(t, len(slopes)) for t in row] for row in sums]
    up = [
        [(in_basis[c], in_whole[_minus(b, c)]) for c in basis if min(_minus(b, c)) >= 0]
        for b in whole
    ]
    down = [
        [(in_whole[_plus(a, b)], in_whole[b]) for b in whole if sum(a) + sum(b) <= order]
        for a in basis
    ]
    trace = sorted((t for t in whole if harmonic and t[2] >= 2), key=lambda t: -t[2])
    inner = [t for t in whole if sum(t) < order]
    return Tables(
        degree=np.array([sum(t) for t in padded], np.int32),
        monomial=np.array([_parent(t, in_whole) for t in whole], np.int32),
        factor=np.array([1 / max(t[_axis(t)], 1) for t in whole], real),
        kept=np.array([in_whole[t] for t in basis], np.int32),
        trace=np.array(
            [
                [in_whole[t], in_whole[_plus(t, (2, 0, -2))], in_whole[_plus(t, (0, 2, -2))]]
                for t in trace
            ],
            np.int32,
        ).reshape(-1, 3),
        slope_first=_firsts(recursions),
        slope_terms=np.array([t[:2] for t in terms], np.int32).reshape(-1, 2),
        slope_factors=np.array([t[2] for t in terms], real),
        meets=np.array(meets, np.int32),
        meeting=np.array(meeting, np.int16),
        up_first=_firsts(up),
        up=np.array([t for row in up for t in row], np.int16),
        down_first=_firsts(down),
        down=np.array([t for row in down for t in row], np.int16),
        next=np.array([[in_whole[_plus(t, e)] for t in inner] for e in _UNITS], np.int32),
    )


_UNITS: tuple[Index, Index, Index] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


def _indices(order: int, highest: int) -> list[Index]:
    """All (i, j, k) of degree at most `order` with k at most `highest`, by degree, then k."""
    return [
        (i, n - k - i, k)
        for n in range(order + 1)
        for k in range(min(n, highest) + 1)
        for i in range(n - k, -1, -1)
    ]


def _plus(a: Index, b: Index) -> Index:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def _minus(a: Index, b: Index) -> Index:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _axis(t: Index) -> int:
    return max(range(3), key=lambda i: t[i])


def _parent(t: Index, row: dict[Index, int]) -> tuple[int, int]:
    axis = _axis(t)
    return (axis, row[_minus(t, _UNITS[axis])]) if any(t) else (0, 0)


def _recursion(t: Index, harmonic: bool) -> list[tuple[Index, int, float]]:
    """Derivative t as a sum of (earlier derivative, coordinate or 3 for none, factor)."""
    n = sum(t)
    if harmonic and t[2] == 2:
        return [(_plus(t, (2, 0, -2)), 3, -1.0), (_plus(t, (0, 2, -2)), 3, -1.0)]
    terms = []
    for axis, unit in enumerate(_UNITS):
        if t[axis] >= 1:
            terms.append((_minus(t, unit), axis, -(2 * n - 1) / n * t[axis]))
        if t[axis] >= 2:
            twice = _minus(_minus(t, unit), unit)
            terms.append((twice, 3, -(n - 1) / n * t[axis] * (t[axis] - 1)))
    return terms


def _firsts(rows: list[Any]) -> NDArray[np.int32]:
    return np.cumsum([0] + [len(row) for row in rows]).astype(np.int32)


def moment_count(order: int, harmonic: bool) -> int:
    """Numbers in one expansion."""
    return (order + 1) ** 2 if harmonic else prod(order + i for i in (1, 2, 3)) // 6
