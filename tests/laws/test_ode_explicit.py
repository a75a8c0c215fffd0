"""Laws of explicit solvers: closed forms, reference figures, orders, events, control."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from motes import ode
from motes.integrate import methods
from motes.tableau import Explicit

EXPLICIT = [name for name, table in methods().items() if isinstance(table, Explicit)]
ADAPTIVE = [name for name in EXPLICIT if methods()[name].b_low is not None]


def circle(t, y):
    return -y[1], y[0]


compiled_circle = njit(circle)


def driven(t, y):
    """Neither linear nor free of t, so that every order condition matters."""
    return -y[1] * (1 + 0.3 * y[0]), y[0] * (1 + 0.2 * np.sin(t))


@pytest.mark.parametrize(
    ("method", "growth"),
    [("euler", lambda h: (1 + h**2) ** 0.5), ("midpoint", lambda h: (1 + h**4 / 4) ** 0.5)],
)
def test_radius_on_the_circle_grows_as_the_lecture_says(method, growth):
    """Euler: r_n = r0 (1 + h^2)^(n/2); midpoint: r0 (1 + h^4 / 4)^(n/2); exactly, for any h."""
    for h, n in ((0.1, 50), (1.5, 7)):
        r = ode.solve(circle, [1.0, 0.0], (0, h * n), method=method, step=h)
        assert r.steps == n
        assert np.hypot(*r.y[-1]) == pytest.approx(growth(h) ** n, rel=1e-13)


@pytest.mark.parametrize("method", EXPLICIT)
def test_measured_order_is_declared_order(method):
    """The error falls as h^order: the slope of its logarithm."""
    order = methods()[method].order
    n = {1: 4000, 2: 200, 3: 100, 4: 60, 5: 60, 8: 20, 9: 16}[order]
    exact = ode.solve(driven, [1.0, 0.0], (0, 6), method="verner9", step=0.01).y[-1]
    counts = np.array([n, 1.4 * n, 2 * n]).astype(int)
    errors = [
        np.linalg.norm(
            ode.solve(driven, [1.0, 0.0], (0, 6), method=method, step=6 / m).y[-1] - exact
        )
        for m in counts
    ]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order - 0.3 < slope < order + 1


@pytest.mark.parametrize("method", EXPLICIT)
def test_dense_output_has_the_order_of_the_method(method):
    """Its largest error over the span falls as h^order, and it meets every step exactly."""
    order = methods()[method].order
    n = {1: 100, 2: 60, 3: 30, 4: 30, 5: 20, 8: 6, 9: 6}[order]
    times = np.linspace(0, 3, 101)
    exact = np.column_stack([np.cos(times), np.sin(times)])
    errors = []
    for m in (n, 2 * n):
        r = ode.solve(circle, [1.0, 0.0], (0, 3), method=method, step=3 / m)
        assert r(r.t) == pytest.approx(r.y, abs=1e-15)
        errors.append(np.abs(r(times) - exact).max())
    assert np.log2(errors[0] / errors[1]) > order - 0.5


@pytest.mark.parametrize("method", ADAPTIVE)
def test_tolerance_bounds_the_error(method):
    """The global error stays within a small multiple of the tolerance per step."""
    for tolerance in (1e-4, 1e-7):
        r = ode.solve(circle, [1.0, 0.0], (0, 6), method=method, rtol=tolerance, atol=tolerance)
        assert r.success
        exact = np.column_stack([np.cos(r.t), np.sin(r.t)])
        assert np.abs(r.y - exact).max() < 30 * tolerance


def test_compiled_and_plain_solves_agree():
    """One loop serves both: the same steps, but for the rounding of fused multiply-add.

    A first step so short that its error is rounding alone would give that rounding a say.
    """
    for options in ({"method": "rk4", "step": 0.1}, {"method": "dop853", "first_step": 0.1}):
        plain = ode.solve(circle, [1.0, 0.0], (0, 5), **options)
        compiled = ode.solve(compiled_circle, [1.0, 0.0], (0, 5), **options)
        assert compiled.evaluations == plain.evaluations
        assert compiled.y == pytest.approx(plain.y, abs=1e-9)


def test_backward_returns_to_the_start():
    """Solving back over the same span undoes the solve, within its tolerance."""
    there = ode.solve(circle, [1.0, 0.0], (0, 5), method="dop853", rtol=1e-11, atol=1e-11)
    back = ode.solve(circle, there.y[-1], (5, 0), method="dop853", rtol=1e-11, atol=1e-11)
    assert back.t[0] == 5
    assert back.t[-1] == 0
    assert back.y[-1] == pytest.approx([1, 0], abs=1e-9)
    assert back(2.5) == pytest.approx([np.cos(2.5), np.sin(2.5)], abs=1e-9)


def test_states_keep_their_shape():
    def f(t, y):
        assert y.shape == (2, 3)
        return -y

    y0 = np.arange(6.0).reshape(2, 3)
    r = ode.solve(f, y0, (0, 1), at=[0, 0.25, 1], rtol=1e-10, atol=1e-12)
    assert r.y == pytest.approx(np.exp(-r.t)[:, None, None] * y0, abs=1e-8)
    assert r([[0.5], [1.0]]).shape == (2, 1, 2, 3)
    assert ode.solve(lambda t, y: -y, 1.0, (0, 1)).y.ndim == 1


def test_bouncing_ball_hits_the_ground_on_time():
    """Restitution 0.8 from 1 m: the impact times of the closed form, whatever the step."""
    expected = [0.451523641, 1.173961467, 1.751911727, 2.214271935, 2.584160102]
    ground = ode.Event(lambda t, y: y[0], direction=-1, terminal=True)
    for step in (0.3, 0.01):
        t, state, hits = 0.0, np.array([1.0, 0.0]), []
        for _ in expected:
            r = ode.solve(
                lambda t, y: (y[1], -9.81), state, (t, 9), method="rk4", step=step, events=[ground]
            )
            assert "event 0" in r.message
            t, state = r.t[-1], np.array([0.0, -0.8 * r.y[-1, 1]])
            hits.append(t)
        assert hits == pytest.approx(expected, abs=1e-9)


def test_events_are_found_between_steps_in_order_and_direction():
    """sin t crosses 0 at multiples of pi, to the error of steps as long as 2.5."""
    events = [
        lambda t, y: y[1],
        ode.Event(lambda t, y: y[1], direction=1),
        ode.Event(lambda t, y: y[0], direction=-1),
    ]
    r = ode.solve(circle, [1.0, 0.0], (0.1, 10.1), method="verner9", step=2.5, events=events)
    both, rising, falling = r.events
    # y(0.1) = (1, 0): the phase is t - 0.1.
    assert both.t == pytest.approx(0.1 + np.pi * np.arange(1, 4), abs=5e-3)
    assert rising.t == pytest.approx([0.1 + 2 * np.pi], abs=5e-3)
    assert falling.t == pytest.approx(0.1 + np.pi / 2 + 2 * np.pi * np.arange(2), abs=5e-3)
    assert both.y[:, 1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("around", [lambda f: f, njit], ids=["plain", "compiled"])
def test_zeros_that_come_back_within_a_step_are_not_missed(around):
    """Two zeros in one step leave the signs at its ends alike: parts of the step are looked at."""

    def still(t, y):
        return (0.0 * y[0],)

    def twice(t, y):
        return (t - 0.3) * (t - 0.6)

    f, g = around(still), around(twice)
    events = [g, ode.Event(g, direction=1), ode.Event(g, direction=1, terminal=True)]
    r = ode.solve(f, [1.0], (0, 3), method="rk4", step=1, events=events)
    assert r.events[0].t == pytest.approx([0.3, 0.6], abs=1e-15)
    assert r.events[1].t == pytest.approx([0.6], abs=1e-15)
    assert r.t == pytest.approx([0, 0.6], abs=1e-15)
    assert r.message == "stopped by event 2 at t = 0.6"


def test_steps_follow_proportional_and_integral_control():
    """Each step of bosh3 on y' = -y + t follows from the errors of the two before it."""

    def f(t, y):
        return (-y[0] + t,)

    table, tol = methods()["bosh3"], 1e-6
    r = ode.solve(f, [1.0], (0, 3), method="bosh3", rtol=tol, atol=tol, largest_step=1.0)
    assert r.rejected == 0
    errors = []
    for t, y, h in zip(r.t, r.y[:, 0], np.diff(r.t), strict=False):
        k = []
        for c, row in zip(table.c, table.a, strict=True):
            k.append(f(t + c * h, [y + h * np.dot(row, k)])[0] if k else f(t, [y])[0])
        e = h * (np.dot(table.b, k) - np.dot(table.b_low, k))
        after = y + h * np.dot(table.b, k)
        errors.append(abs(e) / (tol + tol * max(abs(y), abs(after))))
    assert max(errors) < 1
    h = np.diff(r.t)
    for n in range(2, len(h) - 2):
        last, now = max(errors[n - 1], 1e-4) ** (0.15 / 3), errors[n] ** (0.9 / 3)
        assert h[n + 1] == pytest.approx(h[n] * 0.87 * last / now, rel=1e-6)


def test_a_compiled_solve_finds_the_same_events():
    event = njit(lambda t, y: y[1])
    r = ode.solve(compiled_circle, [1.0, 0.0], (0.1, 10.1), rtol=1e-10, events=[event])
    assert r.events[0].t == pytest.approx(0.1 + np.pi * np.arange(1, 4), abs=1e-7)


def test_where_no_step_exists_the_message_says_why():
    """y' = y^2 is infinite at t = 1; y' = 1/(0.5 - t) at 0.5."""
    r = ode.solve(lambda t, y: (1.0, y[1] ** 2), [0.0, 1.0], (0, 2), rtol=1e-8)
    assert not r.success
    assert "y[1]" in r.message
    assert f"t = {r.t[-1]:.10g}" in r.message
    assert r.t[-1] == pytest.approx(1, abs=1e-6)
    r = ode.solve(lambda t, y: y**2, 1e200, (0, 1), method="euler", step=0.1)
    assert not r.success
    assert "y became infinite" in r.message
    assert "max_steps" in ode.solve(circle, [1.0, 0.0], (0, 9), max_steps=3).message


def test_explicit_methods_explode_on_stiff_decay_beyond_their_limit():
    """x' = -k x: Euler multiplies by 1 - h k, and RK4 is stable for h k < 2.785."""
    r = ode.solve(lambda t, x: -1000 * x, 1.0, (0, 0.1), method="euler", step=0.01)
    assert r.y[-1] == pytest.approx(9.0**10)
    for factor, stable in ((2.78, True), (2.79, False)):
        r = ode.solve(lambda t, x: -x, 1.0, (0, factor * 500), method="rk4", step=factor)
        assert (abs(r.y[-1]) < 1) == stable


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "rk4"}, "give it a step"),
        ({"method": "leapfrog", "step": 0.1}, "solve_newton"),
        ({"step": -1.0}, "above 0"),
        ({"at": [2.0]}, "within the span"),
        ({"at": [0.5, 0.2]}, "direction"),
        ({"rtol": -1.0}, "rtol"),
        ({"rtol": [1e-3, 1e-3]}, "rtol must be one number"),
        ({"atol": [1.0, 2.0, 3.0]}, "shape of y0"),
        ({"at": [0.0, np.nan, 1.0]}, "direction"),
        ({"step": 1e-300}, "steps"),
        ({"first_step": np.nan}, "first_step must be above 0"),
        ({"largest_step": 0.0}, "largest_step must be above 0"),
        ({"largest_step": np.nan}, "largest_step must be above 0"),
    ],
)
def test_senseless_arguments_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        ode.solve(circle, [1.0, 0.0], (0, 1), **change)
    with pytest.raises(ValueError, match="finite"):
        ode.solve(circle, [np.nan, 0.0], (0, 1))
    for state in ([], [1j, 0.0]):
        with pytest.raises(ValueError, match="y0 must"):
            ode.solve(circle, state, (0, 1), step=0.1, method="rk4")


@pytest.mark.parametrize("wrong", [lambda t, y: (1.0,) * 3, lambda t, y: y[0], lambda t, y: ()])
def test_a_function_of_another_shape_is_told_so(wrong):
    message = r"gave \d numbers?, shape .* for a state of 2, shape \(2"
    for state in (np.ones(2), np.ones((2, 1))):
        with pytest.raises(ValueError, match=message):
            ode.solve(wrong, state, (0.0, 1.0), method="rk4", step=0.1)


@pytest.mark.parametrize("method", ["rk4", "radau5"])
def test_a_compiled_function_of_another_shape_is_told_so(method):
    """Whether it gives more numbers, fewer, or none, as an array or a tuple."""

    @njit
    def short(t, y):
        return np.array([1.0])

    @njit
    def long(t, y):
        return 1.0, 2.0, 3.0

    @njit
    def nothing(t, y):
        pass

    wrong = [(short, "gave 1 number, "), (long, "gave 3 numbers, "), (nothing, "gave nothing")]
    for f, message in wrong:
        with pytest.raises(ValueError, match=message):
            ode.solve(f, np.ones(2), (0.0, 1.0), method=method, step=0.1)
    with pytest.raises(ValueError, match="gave 1 number, "):
        ode.solve(short, np.ones((1, 2)), (0.0, 1.0), method=method, step=0.1)


def test_arguments_that_a_compiled_function_lacks_are_told():
    @njit
    def decay(t, y, rate):
        return -rate * y

    with pytest.raises(ValueError, match="missing a required argument: 'rate'"):
        ode.solve(decay, np.ones(2), (0.0, 1.0))
    with pytest.raises(ValueError, match="args must be a tuple"):
        ode.solve(decay, np.ones(2), (0.0, 1.0), args=2.0)


def test_events_that_are_none_are_refused():
    for events, message in (
        (None, "events must be a list"),
        ([3], "a function g"),
        ([ode.Event(circle, direction=7)], "-1, 0 or 1"),
    ):
        with pytest.raises(ValueError, match=message):
            ode.solve(circle, [1.0, 0.0], (0, 1), events=events)
