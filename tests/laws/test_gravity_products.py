"""Which products of moments and derivatives a local expansion sums, in what steps."""

from collections import Counter

import numpy as np
import pytest

from motes.interact.gravity.expansions import (
    MOMENTS,
    ROOM,
    derivatives,
    indices,
    places,
    plus,
    row_of,
    stairs,
    terms,
    without_first,
)
from motes.interact.gravity.moments_to_local import moments_to_local
from motes.interact.gravity.translations import padded, width

KINDS = [(order, True) for order in range(2, 15)] + [(order, False) for order in range(2, 9)]


@pytest.mark.parametrize("most", [9, 20])
@pytest.mark.parametrize("above", [-1, 1, 2])
@pytest.mark.parametrize(("order", "harmonic"), KINDS)
def test_every_product_up_to_the_order_is_summed_once(order, harmonic, above, most):
    kind = terms(order, harmonic)
    basis, others = kind.basis, without_first(kind.basis)
    met, written = Counter(), []
    for chunk, steps in stairs(kind, most, above):
        assert len(chunk) <= most
        written += chunk
        for some, first, last in steps:
            assert set(some) <= set(chunk)
            met.update((basis[n], others[k]) for n in some for k in range(first, last))
    assert written == list(range(len(basis)))
    wanted = ((a, b) for a in basis for b in others if above < sum(a) + sum(b) <= order)
    assert met == Counter(wanted)


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


@pytest.mark.parametrize("above", [-1, 2])
@pytest.mark.parametrize(("order", "harmonic"), [(2, True), (5, True), (9, True), (5, False)])
def test_local_terms_are_the_sums_of_moments_times_derivatives(order, harmonic, above):
    """In plain Python, with every product written out."""
    rng = np.random.default_rng(3)
    basis, lanes = terms(order, harmonic).basis, width(np.float64)
    balls, own = rng.random((lanes, 8)), rng.random(8)
    own[:3] += 3.0
    table = rng.random((lanes, padded(len(basis))))
    room, local = np.zeros((ROOM, lanes)), np.zeros((len(basis), lanes))
    rows = np.array(places(harmonic), np.int32)
    operation = moments_to_local(order, harmonic, np.float64, above)
    operation(balls, np.arange(lanes), own, table, 0.1, rows, room, local)
    x, y, z = (own[k] + own[k + 3] - balls[:, k] - balls[:, k + 3] for k in range(3))
    r = np.sqrt(x * x + y * y + z * z + 0.1)
    slopes = derivatives(order, harmonic, (x / r, y / r, z / r), np.ones(lanes))
    for n, a in enumerate(basis):
        exact = sum(
            table[:, k] * (balls[:, 6] / r) ** sum(b) / r * slopes[plus(a, b)]
            for k, b in enumerate(basis)
            if sum(b) != 1 and above < sum(a) + sum(b) <= order
        ) * (own[6] / r) ** sum(a)
        np.testing.assert_allclose(local[n], exact, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize(("order", "harmonic"), [(15, True), (9, False)])
def test_an_order_whose_derivatives_have_no_rows_is_refused(order, harmonic):
    with pytest.raises(ValueError, match=f"at most {order - 1}"):
        moments_to_local(order, harmonic, np.float64)
