"""Laws of time-stepping tables: the order conditions, and that a wrong number is refused."""

from __future__ import annotations

import dataclasses
import math

import pytest

from motes import rooted_trees
from motes.integrate import method, methods
from motes.ode.stability import error_constant
from motes.order_conditions import TableauError
from motes.tableau import Explicit, Implicit, Splitting

NUMBERS = ("a", "a_explicit", "b", "b_position", "c", "d", "drifts", "g", "kicks")


def test_number_of_rooted_trees():
    """OEIS A000081, as in Hairer, Norsett and Wanner I, table II.2.2."""
    counts = [len(rooted_trees.trees(n)) for n in range(1, 10)]
    assert counts == [1, 1, 2, 4, 9, 20, 48, 115, 286]


def test_densities_of_all_trees_obey_cayley():
    """Sum over trees of n! / (symmetry * density) is (n - 1)!; here with symmetry by counting."""

    def symmetry(tree: rooted_trees.Tree) -> int:
        repeats = [tree.count(branch) for branch in set(tree)]
        return math.prod(map(symmetry, tree)) * math.prod(map(math.factorial, repeats))

    for n in range(1, 9):
        orderings = sum(
            math.factorial(n) // (symmetry(t) * rooted_trees.density(t))
            for t in rooted_trees.trees(n)
        )
        assert orderings == math.factorial(n - 1)


def _altered(name: str):
    """The table once for each of its numbers, with that one 0.1 % off."""
    table = methods()[name]
    for field in NUMBERS:
        values = getattr(table, field, None)
        for i, value in enumerate(values or ()):
            row = value if isinstance(value, tuple) else (value,)
            for j, x in enumerate(row):
                wrong = (*row[:j], x * 1.001, *row[j + 1 :])
                changed = wrong if isinstance(value, tuple) else wrong[0]
                if x:
                    yield {field: (*values[:i], changed, *values[i + 1 :])}


@pytest.mark.parametrize("name", sorted(methods()))
def test_every_number_of_every_table_is_checked(name: str):
    for change in _altered(name):
        with pytest.raises(TableauError):
            dataclasses.replace(methods()[name], **change)


@pytest.mark.parametrize("name", sorted(methods()))
def test_no_table_has_a_higher_order_than_it_declares(name: str):
    with pytest.raises(TableauError, match=f"declared order {methods()[name].order + 1}"):
        dataclasses.replace(methods()[name], order=methods()[name].order + 1)


def test_both_parts_of_a_split_method_are_checked_together():
    """An explicit part whose rows add up to c is refused where a condition with both fails."""
    table = methods()["kencarp3"]
    first, second, (x, y), last = table.a_explicit
    with pytest.raises(TableauError, match="split: declared order 3, but an order-3 condition"):
        dataclasses.replace(table, a_explicit=(first, second, (x + 0.001, y - 0.001), last))


def test_weights_of_a_split_method_are_one_for_each_way_to_share_the_vertices():
    weights = rooted_trees.coloured_weights(((), (2.0,)), ((), (3.0,)))
    assert weights(()) == ((1.0, 1.0),)
    assert set(weights(((),))) == {(0.0, 2.0), (0.0, 3.0)}
    assert set(weights(((), ()))) == {(0.0, 4.0), (0.0, 6.0), (0.0, 9.0)}


def test_a_wrong_table_says_what_is_wrong():
    with pytest.raises(
        TableauError,
        match=r"declared order 4, but an order-2 condition gives 0\.583333 instead of 0\.5",
    ):
        Explicit(order=4, c=(0, 1), a=((), (1,)), b=(5 / 12, 7 / 12))


def test_symplectic_methods_are_known_from_their_table():
    """b_i a_ij + b_j a_ji = b_i b_j (Sanz-Serna 1988)."""
    found = {name for name, table in methods().items() if table.symplectic}
    splittings = {name for name, table in methods().items() if isinstance(table, Splitting)}
    assert found == splittings | {"implicit_midpoint"}


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_interpolants_meet_both_ends(share: float):
    """At 0 the weights vanish, at 1 they are b; between, they add up to the share (order 1)."""
    for table in methods().values():
        if isinstance(table, Explicit) and table.interpolates:
            weights = table.interpolant(share)
            assert sum(weights) == pytest.approx(share, abs=1e-12)
            if share in (0.0, 1.0):
                assert weights[: table.stages] == pytest.approx([share * b for b in table.b])


def test_rows_of_implicit_tables_are_whole():
    for table in methods().values():
        if isinstance(table, Implicit):
            assert all(len(row) == len(table.b) for row in table.a)
            diagonal = all(
                row[j] == 0 for i, row in enumerate(table.a) for j in range(i + 1, len(row))
            )
            assert table.diagonal == diagonal


def test_error_constants_are_those_of_the_books():
    """Euler 1/2; bdf2 1/3; leapfrog: sqrt of the squares of its three third-order defects."""
    assert error_constant(method("euler")) == pytest.approx(1 / 2)
    assert error_constant(method("bdf2")) == pytest.approx(1 / 3)
    # Velocity: sum b c^2 - 1/3 and sum b_i a_ij - 1/6; position: sum b_position c - 1/6.
    assert error_constant(method("leapfrog")) == pytest.approx(
        math.hypot(1 / 2 - 1 / 3, 1 / 4 - 1 / 6, 0 - 1 / 6)
    )
    for name, table in methods().items():
        assert error_constant(table) > 1e-7, name
