"""Which products of moments and derivatives a local expansion sums, in what steps."""

from collections import Counter

import pytest

from motes.interact.gravity.expansions import (
    MOMENTS,
    ROOM,
    indices,
    places,
    plus,
    row_of,
    stairs,
    terms,
    without_first,
)

KINDS = [(order, True) for order in range(2, 13)] + [(order, False) for order in range(2, 9)]


@pytest.mark.parametrize("most", [5, 9])
@pytest.mark.parametrize(("order", "harmonic"), KINDS)
def test_every_product_up_to_the_order_is_summed_once(order, harmonic, most):
    kind = terms(order, harmonic)
    basis, others = kind.basis, without_first(kind.basis)
    met, written = Counter(), []
    for chunk, steps in stairs(kind, most):
        assert len(chunk) <= most
        written += chunk
        for some, first, last in steps:
            assert set(some) <= set(chunk)
            met.update((basis[n], others[k]) for n in some for k in range(first, last))
    assert written == list(range(len(basis)))
    assert met == Counter((a, b) for a in basis for b in others if sum(a) + sum(b) <= order)


@pytest.mark.parametrize(("order", "harmonic"), KINDS)
def test_a_derivative_has_the_row_that_a_product_looks_for(order, harmonic):
    kind = terms(order, harmonic)
    derivatives = indices(order, 2 if harmonic else order)
    rows = [row_of(t, harmonic) for t in derivatives]
    assert len(set(rows)) == len(rows)
    assert max(rows) < MOMENTS
    others = without_first(kind.basis)
    assert MOMENTS + len(others) <= ROOM
    assert places(harmonic)[: len(others)] == [row_of(b, harmonic) for b in others]
    for a in kind.basis:
        for b in others:
            assert row_of(plus(a, b), harmonic) == row_of(a, harmonic) + row_of(b, harmonic)
