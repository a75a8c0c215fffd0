"""The order conditions that tables of time-stepping methods must meet."""

from __future__ import annotations

from collections.abc import Sequence

from motes import rooted_trees

TOLERANCE = 1e-12
"""How exactly a table must meet its order conditions, relative to the terms of their sums."""


class TableauError(ValueError):
    """A table does not have the order that it declares."""


def check_sums(c: Sequence[float], a: Sequence[Sequence[float]]) -> None:
    """The times of stages: c_i = sum_j a_ij."""
    for i, (time, row) in enumerate(zip(c, a, strict=True)):
        if abs(sum(row) - time) > TOLERANCE:
            raise TableauError(f"c[{i}] = {time:g}, but row {i} of a adds up to {sum(row):g}")


def check_order(
    what: str, order: int, b: Sequence[float], weight: rooted_trees.Weight, share: float = 1.0
) -> None:
    """Butcher's conditions at a share of the step: sum b_i phi_i(t) = share^|t| / density(t)."""
    for tree in rooted_trees.up_to(order):
        n, density = rooted_trees.vertices(tree), rooted_trees.density(tree)
        check(what, order, n, b, weight(tree), share**n / density)


def check_nystrom(
    order: int, b: Sequence[float], b_position: Sequence[float], weight: rooted_trees.Weight
) -> None:
    """Conditions of a method for x'' = a(t, x), of its velocity and its position."""
    for tree in filter(rooted_trees.special, rooted_trees.up_to(order)):
        n, density = rooted_trees.vertices(tree), rooted_trees.density(tree)
        check("velocity: ", order, n, b, weight(tree), 1 / density)
        check("position: ", order, n + 1, b_position, weight(tree), 1 / ((n + 1) * density))


def check(
    what: str, declared: int, order: int, b: Sequence[float], phi: Sequence[float], target: float
) -> None:
    """One condition: sum b_i phi_i is the target, but for the rounding of its terms."""
    terms = [x * y for x, y in zip(b, phi, strict=True)]
    value, size = sum(terms), max(1.0, *map(abs, terms))
    if order <= declared and abs(value - target) > TOLERANCE * size:
        raise TableauError(
            f"{what}declared order {declared}, but an order-{order} condition gives "
            f"{value:.6g} instead of {target:.6g}"
        )
