"""Rooted trees: one order condition for each, for methods that advance x' = f(x).

A tree is the tuple of its branches, each a tree; the single vertex is `()`. Butcher's theorem: a
method has order p when, for every tree t of at most p vertices, its elementary weight equals
1 / density(t). Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

Tree = tuple[Any, ...]
Rows = Sequence[Sequence[float]]
Weight = Callable[[Tree], tuple[float, ...]]


@cache
def trees(order: int) -> tuple[Tree, ...]:
    """All rooted trees of `order` vertices: 1, 1, 2, 4, 9, 20, 48, 115, 286 for order 1 to 9."""
    return tuple(_forests(order - 1, 1, 0))


@cache
def _forests(size: int, order: int, number: int) -> tuple[Tree, ...]:
    """Multisets of trees with `size` vertices in all, none before tree `number` of its order."""
    if size == 0:
        return ((),)
    return tuple(
        (first, *rest)
        for n in range(order, size + 1)
        for i, first in enumerate(trees(n))
        if n > order or i >= number
        for rest in _forests(size - n, n, i)
    )


@cache
def vertices(tree: Tree) -> int:
    """Number of vertices."""
    return 1 + sum(vertices(branch) for branch in tree)


@cache
def density(tree: Tree) -> int:
    """Product over all vertices of the number of vertices above and including each."""
    return vertices(tree) * math.prod(density(branch) for branch in tree)


def up_to(order: int) -> Iterator[Tree]:
    """All trees of at most `order` vertices, small ones first."""
    for n in range(1, order + 1):
        yield from trees(n)


def special(tree: Tree) -> bool:
    """Whether the tree belongs to x'' = f(x): every branch is a velocity, alone or of an f."""
    return all(b == () or (len(b) == 1 and special(b[0])) for b in tree)


def weight(a: Rows, linear: Rows | None = None) -> Weight:
    """Elementary weights of the stages of a Runge-Kutta method with matrix `a`.

    phi_i(t) = product over branches u of sum_j a_ij phi_j(u). With `linear`, a Rosenbrock method:
    below a vertex with one branch stands alpha + Gamma in place of alpha (Hairer and Wanner II,
    theorem IV.7.3).
    """
    stages = len(a)

    @cache
    def value(tree: Tree) -> tuple[float, ...]:
        rows = linear if linear is not None and len(tree) == 1 else a
        result = [1.0] * stages
        for branch in tree:
            below = value(branch)
            for i, row in enumerate(rows):
                result[i] *= sum(x * y for x, y in zip(row, below, strict=False))
        return tuple(result)

    return value


def coloured_weights(*parts: Rows) -> Callable[[Tree], tuple[tuple[float, ...], ...]]:
    """Elementary weights of an additive method, whose parts of f have a matrix each.

    Every vertex but the root belongs to one part: one weight for each way to choose (Kennedy and
    Carpenter 2003, section 2.1, with weights b that all parts share).
    """
    stages = len(parts[0])

    @cache
    def values(tree: Tree) -> tuple[tuple[float, ...], ...]:
        found = {(1.0,) * stages}
        for branch in tree:
            moved = [
                [sum(x * y for x, y in zip(row, below, strict=False)) for row in a]
                for below in values(branch)
                for a in parts
            ]
            found = {tuple(x * y for x, y in zip(f, m, strict=True)) for f in found for m in moved}
        return tuple(found)

    return values


def nystrom_weight(c: Sequence[float], a: Rows) -> Weight:
    """Elementary weights of a Nystrom method for x'' = f(x), for `special` trees.

    A velocity alone gives c_i, a velocity of an f gives sum_j a_ij phi_j (Hairer, Norsett and
    Wanner I, theorem II.14.13).
    """

    @cache
    def value(tree: Tree) -> tuple[float, ...]:
        result = [1.0] * len(c)
        for branch in tree:
            below = value(branch[0]) if branch else ()
            for i, row in enumerate(a):
                moved = sum(x * y for x, y in zip(row, below, strict=False)) if branch else c[i]
                result[i] *= moved
        return tuple(result)

    return value
