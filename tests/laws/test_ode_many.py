"""Laws of many systems at once: each is solved as if it were alone."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from motes import jit, ode


@njit
def decay(t, y, rate, turn):
    return -rate * y[0] - turn * y[1], -rate * y[1] + turn * y[0]


def exact(t, y0, rate, turn):
    z = (y0[:, 0] + 1j * y0[:, 1]) * np.exp((-rate + 1j * turn) * t)
    return np.column_stack([z.real, z.imag])


def systems(m):
    generator = np.random.default_rng(1)
    return generator.normal(size=(m, 2)), generator.uniform(0.1, 3, m), 2.0


def test_every_system_reaches_its_own_exact_state():
    """z' = (-rate + i turn) z with a rate for each system and one turn for all."""
    y0, rate, turn = systems(2500)
    r = ode.solve_many(
        decay, y0, (0, 3), args=(rate, turn), rtol=1e-8, atol=1e-10, at=[0.0, 1.0, 3.0]
    )
    assert r.success.all()
    assert r.y.shape == (2500, 3, 2)
    for place, t in enumerate(r.t):
        assert r.y[:, place] == pytest.approx(exact(t, y0, rate, turn), abs=1e-6)
    assert len(set(r.steps.tolist())) > 5


def test_a_system_does_not_depend_on_its_neighbours_or_the_threads():
    y0, rate, turn = systems(1500)
    results = []
    for threads in (1, 2, 4):
        jit.threads(threads)
        results.append(ode.solve_many(decay, y0, (0, 3), args=(rate, turn)).y)
    jit.threads(0)
    assert (results[0] == results[1]).all()
    assert (results[0] == results[2]).all()
    some = ode.solve_many(decay, y0[700:709], (0, 3), args=(rate[700:709], turn)).y
    assert (some == results[0][700:709]).all()


def test_fixed_steps_are_those_of_a_single_solve():
    y0, rate, turn = systems(20)
    many = ode.solve_many(decay, y0, (1, 2), args=(rate, turn), method="tsit5", step=0.03)
    assert (many.steps == 34).all()
    for k in (0, 19):
        one = ode.solve(decay, y0[k], (1, 2), args=(rate[k], turn), method="tsit5", step=0.03)
        assert many.y[k, 0] == pytest.approx(one.y[-1], abs=1e-14)


def test_functions_of_arrays_and_plain_functions_work_too():
    y0, rate, _ = systems(6)

    def whole(t, y, rate):
        return -rate * y

    for f in (whole, njit(whole)):
        r = ode.solve_many(f, y0, (0, 1), args=(rate,), rtol=1e-9, atol=1e-12)
        assert r.y[:, 0] == pytest.approx(y0 * np.exp(-rate)[:, None], abs=1e-8)


def test_a_system_that_explodes_fails_alone():
    """y' = y^2 from 1 is infinite at t = 1, from 0.1 it is 1/9 then."""
    square = njit(lambda t, y: (y[0] * y[0],))
    r = ode.solve_many(square, [[0.1], [1.0], [0.2]], (0, 2))
    assert r.success.tolist() == [True, False, True]
    assert r.y[[0, 2], 0, 0] == pytest.approx([1 / 8, 1 / 3], rel=1e-5)


def test_a_compiled_function_of_another_shape_or_without_a_number_at_the_start_ends():
    @njit
    def long(t, y):
        return 1.0, 2.0, 3.0

    @njit
    def short(t, y):
        return (1.0,)

    @njit
    def bottomless(t, y):
        return np.nan, y[1]

    for f, message in ((long, "gave 3 numbers, "), (short, "gave 1 number, ")):
        with pytest.raises(ValueError, match=message):
            ode.solve_many(f, np.ones((5, 2)), (0, 1))
    found = ode.solve_many(bottomless, np.ones((5, 2)), (0, 1))
    assert not found.success.any()
    assert found.steps.max() == 0
