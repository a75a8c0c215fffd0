"""Cartesian expansions of a potential: which terms there are, and how they follow from others.

A cell's sources at places s from its center have the moments M_b = sum m (-s)^b / b!, b = (i, j, k)
with i + j + k <= p. At y from the center of another cell, R away, they make the potential
sum_a L_a y^a / a! with L_a = sum_b M_b D_{a+b}, |a| + |b| <= p, D_t the t-th partial derivative of
1 / sqrt(x^2 + e^2) at R. Source: Dehnen, Computational Astrophysics and Cosmology 1 (2014) 1,
section 2.

Where e = 0 the potential is harmonic, d2/dz2 = -d2/dx2 - d2/dy2, and terms with k >= 2 follow from
those with k < 2: (p + 1)^2 numbers instead of (p + 1)(p + 2)(p + 3)/6.

The functions here work on lists of numbers of any kind: of NumPy, or of a formula that is traced.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import factorial, prod
from typing import Any

Index = tuple[int, int, int]
Values = dict[Index, Any]

UNITS: tuple[Index, Index, Index] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

TOGETHER = 6
"""Sums that are formed together: as many as registers hold, with what they share."""


SIDE = {True: 15, False: 9}
"""Derivatives along an axis from 0 up, of harmonic and other potentials."""

MOMENTS = max(3 * SIDE[True] ** 2, SIDE[False] ** 3)
"""Row after those of derivatives."""

ROOM = MOMENTS + SIDE[True] ** 2
"""Rows in all."""


@dataclass(frozen=True)
class Terms:
    """The terms of one order."""

    order: int
    harmonic: bool
    basis: tuple[Index, ...]
    """Those that are kept, by rising degree."""
    every: tuple[Index, ...]
    """All of them; the same where the potential is not harmonic."""


@cache
def terms(order: int, harmonic: bool) -> Terms:
    """The terms of expansions up to degree `order`."""
    every = indices(order, order)
    return Terms(order, harmonic, indices(order, 1) if harmonic else every, every)


def indices(order: int, highest: int) -> tuple[Index, ...]:
    """All (i, j, k) of degree at most `order` with k at most `highest`, by degree, then k."""
    return tuple(
        (i, n - k - i, k)
        for n in range(order + 1)
        for k in range(min(n, highest) + 1)
        for i in range(n - k, -1, -1)
    )


def plus(a: Index, b: Index) -> Index:
    """Sum of two indices."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Index, b: Index) -> Index:
    """Difference of two indices."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def monomials(order: int, place: tuple[Any, Any, Any], one: Any) -> Values:
    """y^a / a! times `one`, all a of degree up to `order`."""
    found = {(0, 0, 0): one}
    for a in indices(order, order)[1:]:
        axis = max(range(3), key=lambda i: a[i])
        step = place[axis] if a[axis] == 1 else place[axis] * (1 / a[axis])
        found[a] = found[minus(a, UNITS[axis])] * step
    return found


def derivatives(order: int, harmonic: bool, place: tuple[Any, Any, Any], one: Any) -> Values:
    """D_t at a place with |R|^2 + e^2 = 1, |t| up to `order`; harmonic ones with k up to 2.

    With d_t = D_t / t!, n = |t|:
    n d_t = -(2n - 1) sum_i x_i d_{t - e_i} - (n - 1) sum_i d_{t - 2 e_i}.
    """
    part = {(0, 0, 0): one}
    for t in indices(order, 1 if harmonic else order)[1:]:
        n = sum(t)
        once = [place[i] * part[minus(t, UNITS[i])] for i in range(3) if t[i] >= 1]
        part[t] = added(once) * (-(2 * n - 1) / n)
        twice = [part[minus(minus(t, e), e)] for i, e in enumerate(UNITS) if t[i] >= 2]
        if twice:
            part[t] = part[t] + added(twice) * (-(n - 1) / n)
    found = {t: scaled(d, prod(factorial(i) for i in t)) for t, d in part.items()}
    if harmonic:
        for t in indices(order, 2):
            if t[2] == 2:
                found[t] = -(found[plus(t, (2, 0, -2))] + found[plus(t, (0, 2, -2))])
    return found


def folded(kind: Terms, whole: Values) -> list[Any]:
    """Moments of the basis from those of all terms."""
    whole = dict(whole)
    if kind.harmonic:
        for t in sorted(kind.every, key=lambda t: -t[2]):
            if t[2] >= 2:
                for step in ((2, 0, -2), (0, 2, -2)):
                    whole[plus(t, step)] = whole[plus(t, step)] - whole[t]
    return [whole[t] for t in kind.basis]


def unfolded(kind: Terms, basis: list[Any]) -> Values:
    """All local terms from those of the basis."""
    whole = dict(zip(kind.basis, basis, strict=True))
    for t in kind.every:
        if t not in whole:
            whole[t] = -(whole[plus(t, (2, 0, -2))] + whole[plus(t, (0, 2, -2))])
    return whole


def shifted_moments(kind: Terms, moments: Values, place: tuple[Any, Any, Any]) -> Values:
    """All moments around another center, from which the old one is at -place.

    M'_b = sum_c M_c place^(b - c) / (b - c)!, one axis after the other, so that sums are short.
    """
    for axis in range(3):
        highest = 1 if kind.harmonic and axis < 2 else kind.order
        wanted = indices(kind.order, highest)
        moments = _along(kind.order, axis, place[axis], moments, wanted, -1)
    return moments


def shifted_terms(kind: Terms, values: Values, place: tuple[Any, Any, Any]) -> list[Any]:
    """Terms of the basis at a place, from all terms: L'_a = sum_b L_{a + b} place^b / b!."""
    for axis in (2, 1, 0):
        values = _along(kind.order, axis, place[axis], values, kind.basis, 1)
    return [values[a] for a in kind.basis]


def _along(
    order: int, axis: int, step: Any, values: Values, wanted: tuple[Index, ...], way: int
) -> Values:
    """Sums over m of values m places along an axis, forwards or backwards, times step^m / m!."""
    factors = [1.0, step]
    for m in range(2, order + 1):
        factors.append(factors[-1] * (step * (1 / m)))
    sums = []
    for a in wanted:
        places = []
        for m in range(order + 1):
            b = list(a)
            b[axis] += way * m
            places.append((values.get((b[0], b[1], b[2])), m))
        sums.append([(value, factors[m]) for value, m in places if value is not None])
    return dict(zip(wanted, products(sums), strict=True))


def row_of(t: Index, harmonic: bool) -> int:
    """Row of D_t where sums over pairs of terms look for it: row_of(a + b) is the sum of rows."""
    side = SIDE[harmonic]
    return t[0] + side * (t[1] + side * t[2])


def without_first(basis: tuple[Index, ...]) -> list[Index]:
    """The terms of another degree than the first."""
    return [b for b in basis if sum(b) != 1]


@cache
def places(harmonic: bool) -> list[int]:
    """Rows of D_b for the terms of `without_first`, which are the same for all orders."""
    return [row_of(b, harmonic) for b in without_first(terms(SIDE[harmonic] - 1, harmonic).basis)]


def stairs(
    kind: Terms, most: int, above: int = -1
) -> list[tuple[range, list[tuple[range, int, int]]]]:
    """Which a and b the sums over b of M_b D_{a+b}, above < |a| + |b| <= p, are over, step by step.

    For places of up to `most` a in the basis each: steps of some of them, and the first and
    last + 1 of the b among `without_first`, all of which go with all a of the step. `above` is at
    most p.
    """
    order, basis = kind.order, kind.basis
    ends = [sum(sum(b) <= degree for b in without_first(basis)) for degree in range(order + 1)]

    def partners(n: int) -> tuple[int, int]:
        degree = sum(basis[n])
        return ends[above - degree] if above >= degree else 0, ends[order - degree]

    steps, first = [], 0
    while first < len(basis):
        degree = sum(basis[first])
        while sum(sum(a) <= degree + 1 for a in basis) - first <= most and degree < order:
            degree += 1
        last = sum(sum(a) <= degree for a in basis)
        parts = -(-(last - first) // most)
        cuts = [first + (last - first) * k // parts for k in range(parts + 1)]
        for low, high in pairwise(cuts):
            found = {n: partners(n) for n in range(low, high)}
            some = []
            for begin, end in pairwise(sorted({b for pair in found.values() for b in pair})):
                those = [n for n, (b, e) in found.items() if b <= begin and end <= e]
                if those:
                    some.append((range(those[0], those[-1] + 1), begin, end))
            steps.append((range(low, high), some))
        first = last
    return steps


def powers(order: int, ratio: Any, one: Any) -> list[Any]:
    """one, one * ratio, ... up to the `order`-th power."""
    found = [one]
    for _ in range(order):
        found.append(found[-1] * ratio)
    return found


def products(sums: list[list[tuple[Any, Any]]]) -> list[Any]:
    """Sums of products, some at a time: a processor begins the next sum before one is done."""
    found: list[Any] = []
    for first in range(0, len(sums), TOGETHER):
        some = sums[first : first + TOGETHER]
        values: list[Any] = [None] * len(some)
        for k in range(max(map(len, some))):
            for n, pairs in enumerate(some):
                if k < len(pairs):
                    product = scaled(*pairs[k])
                    values[n] = product if values[n] is None else values[n] + product
        found += values
    return found


def added(values: list[Any]) -> Any:
    """Sum of at least one."""
    result = values[0]
    for value in values[1:]:
        result = result + value
    return result


def scaled(value: Any, factor: Any) -> Any:
    """The product, which costs nothing where the factor is the number 1."""
    return value if isinstance(factor, int | float) and factor == 1 else value * factor
