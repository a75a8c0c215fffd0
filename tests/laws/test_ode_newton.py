"""Laws of methods for x'' = a(t, x, v): reference orbits, energy, reversal, exact drag."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from motes import ode
from motes.integrate import methods
from motes.tableau import Nystrom, Splitting

SECOND_ORDER = [n for n, t in methods().items() if isinstance(t, Nystrom | Splitting)]

KEPLER = {
    "euler": (1.905824e00, 1.193491e00, 6.856014e-01),
    "semi_implicit_euler": (1.740976e-02, 4.348412e-03, 1.086820e-03),
    "midpoint": (7.342448e-03, 1.891219e-03, 4.796857e-04),
    "leapfrog": (7.083698e-03, 1.769537e-03, 4.422970e-04),
    "yoshida4": (8.537608e-06, 5.341476e-07, 3.339277e-08),
    "rk4": (5.441048e-07, 3.154061e-08, 1.894900e-09),
}
"""Position error after one period of the orbit below with 500, 1000 and 2000 steps."""

X0, V0 = [0.5, 0.0], [0.0, np.sqrt(3)]
"""Kepler orbit of eccentricity 0.5 from its pericentre, GM = a = 1."""

FIGURE_EIGHT = np.array([0.97000436, -0.24308753]), np.array([-0.93240737, -0.86473146])
PERIOD_EIGHT = 6.32591398


@njit
def gravity(t, x, v):
    r3 = (x[0] * x[0] + x[1] * x[1]) ** 1.5
    return -x[0] / r3, -x[1] / r3


def energy(x, v):
    return 0.5 * (v**2).sum(-1) - 1 / np.hypot(x[..., 0], x[..., 1])


@pytest.mark.parametrize("method", KEPLER)
def test_kepler_table_to_the_digits(method):
    for steps, expected in zip((500, 1000, 2000), KEPLER[method], strict=True):
        r = ode.solve_newton(
            gravity.py_func, X0, V0, (0, 2 * np.pi), method=method, step=2 * np.pi / steps
        )
        assert r.steps == steps
        # Seven digits; the rounding of up to 2000 steps.
        assert np.hypot(*(r.x[-1] - X0)) == pytest.approx(expected, rel=4e-7, abs=3e-13)


@pytest.mark.parametrize("method", SECOND_ORDER)
def test_measured_order_is_declared_order(method):
    """x'' = -x + 0.3 x^2 + 0.2 sin t: the slope of the error's logarithm."""

    def a(t, x, v):
        return -x + 0.3 * x * x + 0.2 * np.sin(t)

    order = methods()[method].order
    n = {1: 800, 2: 100, 4: 40, 5: 40, 6: 40, 8: 70}[order]
    counts = np.array([n, 1.4 * n, 2 * n]).astype(int)
    exact = ode.solve_newton(a, 1.0, 0.0, (0, 5), method="verner9", step=0.01)
    errors = []
    for m in counts:
        r = ode.solve_newton(a, 1.0, 0.0, (0, 5), method=method, step=5 / m)
        errors.append(np.hypot(r.x[-1] - exact.x[-1], r.v[-1] - exact.v[-1]))
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order - 0.3 < slope < order + 1


@pytest.mark.parametrize("method", SECOND_ORDER)
def test_dense_output_is_a_partial_step(method):
    """It meets every step, and in between is what the method itself gives there."""
    r = ode.solve_newton(gravity.py_func, X0, V0, (0, 1), method=method, step=0.1)
    x, v = r(r.t)
    assert x == pytest.approx(r.x, abs=1e-14)
    assert v == pytest.approx(r.v, abs=1e-14)
    part = ode.solve_newton(gravity.py_func, r.x[3], r.v[3], (0, 0.04), method=method, step=0.04)
    assert r(0.34)[0] == pytest.approx(part.x[-1], abs=1e-13)


def test_symplectic_methods_bound_the_energy_and_others_drift():
    """100 periods of 200 steps, max |dE/E|: leapfrog 2.689e-3, Yoshida4 2.02e-5, RK4 9.33e-5."""
    h, end = 2 * np.pi / 200, 200 * np.pi
    for method, expected in (("leapfrog", 2.689e-3), ("yoshida4", 2.02e-5), ("rk4", 9.33e-5)):
        r = ode.solve_newton(gravity, X0, V0, (0, end), method=method, step=h)
        error = np.abs(energy(r.x, r.v) / energy(r.x[0], r.v[0]) - 1)
        assert error.max() == pytest.approx(expected, rel=2e-3)
        grows = error[-2000:].max() / error[:2000].max()
        assert (grows > 5) == (method == "rk4")


@pytest.mark.parametrize(
    ("method", "bounded"),
    [(name, True) for name, table in methods().items() if table.symplectic]
    + [(name, False) for name in ("ralston", "midpoint", "rk4", "dopri5", "nystrom5", "sdirk2")],
)
def test_over_a_thousand_periods_symplectic_methods_alone_bound_the_energy(method, bounded):
    """Twenty times as long makes no symplectic method's worst error worse, and every other's."""
    h, period = 2 * np.pi / 100, 2 * np.pi
    at = np.linspace(0, 1000 * period, 20_001)
    r = ode.solve_newton(gravity, X0, V0, (0, at[-1]), method=method, step=h, at=at, dense=False)
    error = np.abs(energy(r.x, r.v) / energy(r.x[0], r.v[0]) - 1)
    assert (error.max() < 1.2 * error[:1000].max()) == bounded


@pytest.mark.slow
def test_energy_stays_bounded_for_a_hundred_thousand_periods():
    """Leapfrog's energy error after 1e5 periods is what it was after ten."""
    h, periods = 2 * np.pi / 100, 100_000
    at = 2 * np.pi * np.linspace(0, periods, 20_001)
    r = ode.solve_newton(
        gravity, X0, V0, (0, at[-1]), method="leapfrog", step=h, at=at + 0.0, dense=False
    )
    error = np.abs(energy(r.x, r.v) / energy(r.x[0], r.v[0]) - 1)
    assert error[-2000:].max() < 1.1 * error[:2000].max()


@pytest.mark.parametrize("method", [n for n in SECOND_ORDER if n.startswith(("leap", "pos", "yo"))])
def test_symmetric_splittings_run_backward_to_where_they_began(method):
    """Time reversal: exact but for rounding, at any step."""
    there = ode.solve_newton(gravity.py_func, X0, V0, (0, 3), method=method, step=0.05)
    back = ode.solve_newton(
        gravity.py_func, there.x[-1], there.v[-1], (3, 0), method=method, step=0.05
    )
    assert back.x[-1] == pytest.approx(X0, abs=1e-12)
    assert back.v[-1] == pytest.approx(V0, abs=1e-12)


def test_a_promise_of_no_velocity_saves_evaluations_and_nothing_else():
    r = [
        ode.solve_newton(gravity, X0, V0, (0, 6), step=0.01, conservative=promise)
        for promise in (False, True)
    ]
    assert (r[0].evaluations, r[1].evaluations) == (1200, 601)
    assert (r[0].x == r[1].x).all()


def test_drag_in_a_splitting_is_exact_at_any_step():
    """x'' = -k x' alone: v = v0 exp(-k t) whatever the step; with a spring, order 2."""
    r = ode.solve_newton(lambda t, x, v: 0 * x, 0.0, 1.0, (0, 1), step=0.25, drag=3.0)
    assert r.v == pytest.approx(np.exp(-3 * r.t), rel=1e-13)
    glue = ode.solve_newton(lambda t, x, v: -x, 1.0, 1.0, (0, 1), step=0.5, drag=1e6)
    assert abs(glue.v[-1]) < 2e-6
    root = np.sqrt(1 - 0.2**2)
    exact = np.exp(-0.2 * 5) * (np.cos(root * 5) + 0.2 / root * np.sin(root * 5))
    error = [
        ode.solve_newton(
            lambda t, x, v: -x, 1.0, 0.0, (0, 5), method="position_verlet", step=h, drag=0.4
        ).x[-1] - exact
        for h in (0.1, 0.05)
    ]  # fmt: skip
    assert error[0] / error[1] == pytest.approx(4, rel=0.05)
    with pytest.raises(ValueError, match="leapfrog"):
        ode.solve_newton(lambda t, x, v: -x, 1.0, 0.0, (0, 5), method="yoshida4", step=1, drag=1)


def three_bodies(t, x, v):
    a = np.zeros_like(x)
    for i in range(3):
        for j in range(3):
            if i != j:
                d = x[j] - x[i]
                a[i] += d / (d @ d) ** 1.5
    return a


def test_figure_eight_closes():
    """Chenciner and Montgomery's orbit, Simo's eight digits: closed within 3.9e-8 of a period."""
    x1, v3 = FIGURE_EIGHT
    x = np.array([x1, -x1, 0 * x1])
    v = np.array([-v3 / 2, -v3 / 2, v3])
    r = ode.solve_newton(
        three_bodies, x, v, (0, PERIOD_EIGHT), method="dop853", rtol=1e-12, atol=1e-12
    )
    assert np.abs(r.x[-1] - x).max() == pytest.approx(3.9e-8, rel=0.5)
    pairs = [(0, 1), (0, 2), (1, 2)]
    for k in (0, -1):
        e = 0.5 * (r.v[k] ** 2).sum()
        e -= sum(1 / np.linalg.norm(r.x[k, i] - r.x[k, j]) for i, j in pairs)
        assert e == pytest.approx(-1.287141991766326, abs=1e-10)


# fmt: off
PLEIADES = np.array([
    [0.3706139143970502, 3.237284092057233, -3.222559032418324, 0.6597091455775310,
     0.3425581707156584, 1.562172101400631, -0.7003092922212495],
    [-3.943437585517392, -3.271380973972550, 5.225081843456543, -2.590612434977470,
     1.198213693392275, -0.2429682344935824, 1.091449240428980],
])
# fmt: on
"""Positions at t = 3: the IVP test set."""


@njit
def pleiades(t, x, v):
    a = np.zeros((2, 7))
    for i in range(7):
        for j in range(7):
            if i != j:
                dx, dy = x[0, j] - x[0, i], x[1, j] - x[1, i]
                w = (j + 1) / (dx * dx + dy * dy) ** 1.5
                a[0, i] += w * dx
                a[1, i] += w * dy
    return a


def test_pleiades_end_where_the_test_set_says():
    x = np.array([[3, 3, -1, -3, 2, -2, 2], [3, -3, 2, 0, 0, -4, 4]], float)
    v = np.zeros((2, 7))
    v[0, 5:] = 1.75, -1.5
    v[1, 3:5] = -1.25, 1.0
    for method in ("dop853", "verner9"):
        r = ode.solve_newton(pleiades, x, v, (0, 3), method=method, rtol=1e-12, atol=1e-12)
        assert r.success
        assert np.abs(r.x[-1] - PLEIADES).max() < 1e-9


def test_events_of_second_order_systems_see_position_and_velocity():
    """The pericentre and apocentre of the orbit: x . v = 0."""
    r = ode.solve_newton(
        gravity.py_func, X0, V0, (0.0, 7.0), method="yoshida6", step=0.05,
        events=[ode.Event(lambda t, x, v: x @ v, direction=-1, terminal=True)],
    )  # fmt: skip
    assert r.t[-1] == pytest.approx(np.pi, abs=1e-5)
    assert r.events[0].y[0, 0] == pytest.approx([-1.5, 0], abs=1e-5)


@pytest.mark.parametrize("method", ["leapfrog", "nystrom5", "rk4"])
def test_a_compiled_acceleration_of_another_shape_is_told_so(method):
    @njit
    def short(t, x, v):
        return np.array([1.0])

    @njit
    def long(t, x, v):
        return 1.0, 2.0, 3.0

    for f, message in ((short, "gave 1 number, "), (long, "gave 3 numbers, ")):
        with pytest.raises(ValueError, match=message):
            ode.solve_newton(f, np.ones(2), np.ones(2), (0, 1), method=method, step=0.1)
