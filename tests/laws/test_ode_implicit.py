"""Laws of implicit methods: orders, stability at any step, stiff reference figures, Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from motes import ode
from motes.integrate import methods

IMPLICIT = [name for name, table in methods().items() if table.implicit]
PAIRS = ["kencarp3", "kencarp4"]
L_STABLE = ["backward_euler", "bdf2", *PAIRS, "radau5", "rodas4", "sdirk2"]


def driven(t, y):
    return -y[1] * (1 + 0.3 * y[0]), y[0] * (1 + 0.2 * np.sin(t))


@pytest.mark.parametrize("method", IMPLICIT)
def test_measured_order_is_declared_order(method):
    """Halving the step divides the error by 2^order."""
    order = methods()[method].order
    n = {1: 200, 2: 60, 3: 30, 4: 20, 5: 12}[order]
    exact = ode.solve(driven, [1.0, 0.0], (0, 6), method="verner9", step=0.01).y[-1]
    errors = [
        np.linalg.norm(
            ode.solve(driven, [1.0, 0.0], (0, 6), method=method, step=6 / m).y[-1] - exact
        )
        for m in (n, 2 * n)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("method", IMPLICIT)
def test_dense_output_has_the_order_of_the_method(method):
    """Its largest error falls as h^order, as that of the steps does."""
    order = methods()[method].order
    n = {1: 60, 2: 30, 3: 20, 4: 12, 5: 8}[order]
    times = np.linspace(0, 3, 31)
    exact = np.column_stack([np.cos(times), np.sin(times)])
    errors = []
    for m in (n, 2 * n):
        r = ode.solve(lambda t, y: (-y[1], y[0]), [1.0, 0.0], (0, 3), method=method, step=3 / m)
        errors.append(np.abs(r(times) - exact).max())
    assert np.log2(errors[0] / errors[1]) > order - 0.4


@pytest.mark.parametrize("method", IMPLICIT)
def test_stiff_decay_never_grows(method):
    """x' = -k x at h = 1e6 / k: A-stable methods do not grow, L-stable ones all but end it."""
    k = 1000.0
    r = ode.solve(lambda t, x: -k * x, 1.0, (0, 1e4), method=method, step=1e6 / k)
    assert (np.abs(r.y) <= 1).all()
    if method in L_STABLE:
        assert abs(r.y[-1]) < 1e-20


def test_backward_euler_divides_stiff_decay_by_eleven():
    """x' = -k x, k = 1000, h = 0.01: implicit Euler multiplies by 1 / 11."""
    r = ode.solve(lambda t, x: -1000 * x, 1.0, (0, 0.1), method="backward_euler", step=0.01)
    assert r.y == pytest.approx(11.0 ** -np.arange(11), rel=1e-10)


def test_radius_on_the_circle():
    """Implicit Euler shrinks by 1 / sqrt(1 + h^2); midpoint and trapezoid keep the radius."""
    for method, factor in (
        ("backward_euler", (1 + 0.5**2) ** -0.5),
        ("implicit_midpoint", 1.0),
        ("trapezoid", 1.0),
    ):
        r = ode.solve(lambda t, y: (-y[1], y[0]), [1.0, 0.0], (0, 10), method=method, step=0.5)
        radius = np.hypot(*r.y.T)
        assert radius == pytest.approx(factor ** np.arange(21), rel=1e-11)


def van_der_pol(t, y):
    return y[1], 1000 * (1 - y[0] ** 2) * y[1] - y[0]


@pytest.mark.parametrize("method", ["kencarp4", "radau5", "rodas4"])
def test_stiff_van_der_pol_ends_where_the_test_set_says(method):
    """mu = 1000 to t = 2000: y = 1.706167732170483, -8.928097010247975e-4 (IVP test set)."""
    r = ode.solve(van_der_pol, [2.0, 0.0], (0, 2000), method=method, rtol=1e-6, atol=1e-8)
    assert r.success
    assert r.steps < 2000
    assert r.y[-1] == pytest.approx([1.706167732170483, -8.928097010247975e-4], rel=1e-4)


@pytest.mark.parametrize("method", IMPLICIT)
def test_every_implicit_method_chooses_its_steps(method):
    """The error per step stays near the tolerance, so that it falls with it; compiled as well."""
    loose, tight = (1e-3, 1e-4) if methods()[method].order == 1 else (1e-4, 1e-6)
    low, order = getattr(methods()[method], "low_order", 2), methods()[method].order
    errors = []
    for tolerance in (loose, tight):
        r = ode.solve(
            lambda t, y: (-y[1], y[0]), [1.0, 0.0], (0, 6), method=method, rtol=tolerance,
            atol=tolerance,
        )  # fmt: skip
        assert r.success
        exact = np.column_stack([np.cos(r.t), np.sin(r.t)])
        errors.append(np.abs(r.y - exact).max())
    # Errors of steps of one tolerance add up to tolerance^(order / (order of the estimate)).
    share = order / (min(order, low) + 1)
    assert errors[1] < 2 * errors[0] * (tight / loose) ** share
    assert errors[0] < 0.2


@pytest.mark.parametrize("method", ["bdf2", "radau5", "sdirk2"])
def test_compiled_implicit_solves_are_those_of_a_plain_function(method):
    """One source serves both, Newton's method and matrices included."""
    plain = ode.solve(stiff, [2.0, 0.0], (0, 4), method=method, rtol=1e-5, atol=1e-7)
    fast = ode.solve(njit(stiff), [2.0, 0.0], (0, 4), method=method, rtol=1e-5, atol=1e-7)
    assert fast.evaluations == plain.evaluations
    assert fast.y == pytest.approx(plain.y, rel=1e-8, abs=1e-10)


def stiff(t, y):
    return y[1], 50 * (1 - y[0] ** 2) * y[1] - y[0]


def test_every_way_to_the_jacobian_leads_to_the_same_solution():
    """Differences, coloured differences, the user's own, Krylov: heat on a rod, tridiagonal."""
    n = 20

    def heat(t, y):
        wide = np.concatenate([[0.0], y, [0.0]])
        return n * n * (wide[2:] - 2 * y + wide[:-2])

    matrix = n * n * (np.eye(n, k=1) - 2 * np.eye(n) + np.eye(n, k=-1))
    y0 = np.sin(np.pi * np.arange(1, n + 1) / (n + 1))
    rate = 4 * n * n * np.sin(np.pi / 2 / (n + 1)) ** 2
    used = {}
    for name, newton in {
        "differences": ode.Newton(),
        "coloured": ode.Newton(sparsity=matrix != 0),
        "given": ode.Newton(jacobian=lambda t, y: matrix),
        "krylov": ode.Newton(solver="krylov"),
    }.items():
        r = ode.solve(heat, y0, (0, 0.1), method="sdirk2", step=0.005, newton=newton)
        # The slowest mode decays as its own exponential, to the method's order.
        assert r.y[-1] == pytest.approx(np.exp(-rate * 0.1) * y0, rel=2e-3)
        used[name] = r.evaluations
    assert used["given"] < used["coloured"] < used["differences"]
    assert used["differences"] - used["given"] >= 20 * 20
    # Three colours in twenty steps, and a few iterations more with an inexact matrix.
    assert 20 * 3 <= used["coloured"] - used["given"] < 20 * 6


def test_a_step_without_a_solution_is_named():
    """y1 = y0 + h y1^2 has no real solution for h y0 > 1/4."""
    r = ode.solve(lambda t, y: y**2, 1.0, (0, 5), method="backward_euler", step=1.0)
    assert not r.success
    assert "smaller step" in r.message


def test_stability_on_the_axes():
    """Euler 2, RK4 2.785 and 2.828 (Hairer and Wanner II, section IV.2); leapfrog h w = 2."""
    facts = {m.name: m for m in ode.methods()}
    assert facts["euler"].real == pytest.approx(2, abs=1e-5)
    assert facts["rk4"].real == pytest.approx(2.785, abs=1e-3)
    assert facts["rk4"].imaginary == pytest.approx(2.828, abs=1e-3)
    assert facts["leapfrog"].imaginary == pytest.approx(2, abs=1e-4)
    assert facts["euler"].imaginary == 0
    for name in IMPLICIT:
        assert facts[name].real == np.inf
        assert facts[name].imaginary == np.inf
    assert facts["dopri5"].embedded == 4
    assert facts["rk4"].embedded is None


# ---------------------------------------------------------------------------- a stiff part alone


def turning(t, y):
    return -y[1] * (1 + 0.3 * y[0]), y[0]


def dragging(t, y):
    return -0.3 * y[0] ** 3, y[0] * 0.2 * np.sin(t) - 0.5 * y[1]


def together(t, y):
    f, g = turning(t, y), dragging(t, y)
    return f[0] + g[0], f[1] + g[1]


@pytest.mark.parametrize("method", PAIRS)
@pytest.mark.parametrize("turned", [False, True], ids=["f explicit", "f implicit"])
def test_a_pair_has_its_order_whichever_part_is_implicit(method, turned):
    """Halving the step divides the error by 2^order, with both parts nonlinear or with time."""
    order = methods()[method].order
    f, g = (dragging, turning) if turned else (turning, dragging)
    exact = ode.solve(together, [1.0, 0.3], (0, 4), method="verner9", step=0.01).y[-1]
    errors = [
        np.linalg.norm(
            ode.solve(f, [1.0, 0.3], (0, 4), method=method, step=4 / m, stiff=g).y[-1] - exact
        )
        for m in (80, 160)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize("method", PAIRS)
def test_a_stiff_part_bounds_no_step(method):
    """x' = cos t - k (x - sin t), x = sin t: the step follows the slow motion, not k.

    Order reduction leaves an error of h^2 of the explicit part, whatever k.
    """
    k = 1e6

    def slow(t, x):
        return np.cos(t) + 0 * x

    def drag(t, x):
        return -k * (x - np.sin(t))

    r = ode.solve(slow, 1.0, (0, 20), method=method, rtol=1e-5, atol=1e-6, stiff=drag)
    assert r.success
    assert r.y[-1] == pytest.approx(np.sin(20), abs=30e-5)
    assert r.steps < 20 * k / 2.8 / 1000  # Explicit methods need a thousand times as many.
    fixed = ode.solve(slow, 1.0, (0, 20), method=method, step=0.2, stiff=drag)
    assert fixed.y[-1] == pytest.approx(np.sin(20), abs=0.2**2 / 4)
    explicit = ode.solve(drag, 1.0, (0, 20), method=method, step=0.2, stiff=slow)
    assert not explicit.success or abs(explicit.y[-1]) > 1e9


def test_compiled_pairs_are_those_of_plain_functions():
    """The same steps; evaluations count both parts, and `newton` serves the stiff one."""
    for options in ({"step": 0.1}, {"rtol": 1e-7}, {"newton": ode.Newton(solver="krylov")}):
        given = {"method": "kencarp4", "rtol": 1e-5, "stiff": dragging, **options}
        plain = ode.solve(turning, [1.0, 0.3], (0, 4), **given)
        given["stiff"] = njit(dragging)
        fast = ode.solve(njit(turning), [1.0, 0.3], (0, 4), **given)
        assert fast.evaluations == plain.evaluations
        assert fast.y == pytest.approx(plain.y, abs=1e-7)
        assert fast.evaluations > 6 * 2 * fast.steps


def test_only_pairs_take_a_stiff_part():
    with pytest.raises(ValueError, match='"radau5" takes y\' whole; kencarp3 and kencarp4 take'):
        ode.solve(turning, [1.0, 0.0], (0, 1), method="radau5", stiff=dragging)
