"""Splines against closed forms, SciPy's oracles, and the laws that tie value, integral, inverse."""

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from motes.control.spline import Spline
from motes.control.spline_kernels import spline_at
from motes.jit import jit

TIMES = [0.0, 0.5, 1.5, 2.0, 4.0]
VALUES = [0.0, 2.0, 2.5, 0.5, 3.0]
KINDS = ["linear", "constant", "smooth", "monotone", "bezier"]


def spline_of(kind, times=TIMES, values=VALUES, **beyond):
    if kind != "bezier":
        return Spline(times, values, kind, **beyond)
    count = len(times)
    left = np.column_stack([np.linspace(-0.1, -0.7, count), np.linspace(-0.3, 0.4, count)])
    right = np.column_stack([np.linspace(0.6, 0.05, count), np.linspace(0.2, -0.2, count)])
    return Spline(times, values, kind, handles=np.stack([left, right], axis=1), **beyond)


@pytest.mark.parametrize("kind", KINDS)
def test_a_spline_goes_through_its_keys(kind):
    assert spline_of(kind)(TIMES).tolist() == VALUES


def test_linear_is_linear_and_constant_waits_for_the_next_key():
    t = np.linspace(0, 4, 997)
    np.testing.assert_allclose(spline_of("linear")(t), np.interp(t, TIMES, VALUES), atol=1e-15)
    assert spline_of("constant")([0.4999, 0.5, 3.999, 4.0, 9.0]).tolist() == [0, 2, 0.5, 3, 3]


@pytest.mark.parametrize("count", [2, 3, 5, 40])
def test_monotone_is_the_pchip_interpolant(count):
    random = np.random.default_rng(count)
    times = np.cumsum(random.uniform(0.1, 2, count))
    values = np.round(random.normal(size=count), 1)
    t = np.linspace(times[0], times[-1], 1001)
    expected = PchipInterpolator(times, values)(t)
    np.testing.assert_allclose(Spline(times, values, "monotone")(t), expected, atol=1e-13)


def test_bezier_with_handles_of_a_cubic_reproduces_the_cubic():
    times = np.array([-1.0, 0.5, 3.0])

    def cubic(t):
        return 2 - t + 0.5 * t**2 - 0.3 * t**3

    def rate(t):
        return -1 + t - 0.9 * t**2

    before, after = np.diff(times, prepend=-2) / 3, np.diff(times, append=4) / 3
    left = np.column_stack([-before, -before * rate(times)])
    right = np.column_stack([after, after * rate(times)])
    handles = np.stack([left, right], axis=1)
    spline = Spline(times, cubic(times), "bezier", handles=handles)
    t = np.linspace(-1, 3, 501)
    np.testing.assert_allclose(spline(t), cubic(t), atol=1e-14)


def test_bezier_follows_the_parametric_curve_of_its_four_points():
    """(t, v) = sum of Bernstein polynomials times control points."""
    u = np.linspace(0, 1, 301)
    points = np.array([[0, 0], [0.9, 3], [0.3, -2], [1, 1]])
    weights = np.array([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])
    t, v = points.T @ weights
    handles = [[[0, 0], points[1] - points[0]], [points[2] - points[3], [0, 0]]]
    spline = Spline([0, 1], [0, 1], "bezier", handles=handles)
    np.testing.assert_allclose(spline(t), v, atol=1e-12)


def test_handles_longer_than_their_segment_keep_time_running_forwards():
    spline = Spline([0, 1], [0, 1], "bezier", handles=[[[0, 0], [5, 0]], [[-5, 0], [0, 0]]])
    shortened = Spline([0, 1], [0, 1], "bezier", handles=[[[0, 0], [1, 0]], [[-1, 0], [0, 0]]])
    t = np.linspace(0, 1, 1001)
    assert (spline(t) == shortened(t)).all()
    assert (np.diff(spline(t)) >= 0).all()


@pytest.mark.parametrize("kind", ["smooth", "monotone"])
def test_no_segment_leaves_the_range_of_its_keys(kind):
    random = np.random.default_rng(2)
    times, values = np.cumsum(random.uniform(0.05, 3, 60)), random.normal(size=60)
    spline = Spline(times, values, kind)
    for i in range(59):
        part = spline(np.linspace(times[i], times[i + 1], 200)[:-1])
        low, high = sorted(values[i : i + 2])
        assert low - 1e-14 <= part.min()
        assert part.max() <= high + 1e-14


@pytest.mark.parametrize("kind", ["smooth", "monotone"])
def test_the_first_derivative_is_continuous(kind):
    """Across a key the one-sided slopes differ by O(h), as h -> 0."""
    spline, h = spline_of(kind), 1e-6
    for key in TIMES[1:-1]:
        left = (spline(key) - spline(key - h)) / h
        right = (spline(key + h) - spline(key)) / h
        assert abs(left - right) < 100 * h


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("beyond", ["hold", "loop", "pingpong", "extend"])
def test_beyond_the_ends(kind, beyond):
    spline = spline_of(kind, before=beyond, after=beyond)
    inside = spline_of(kind)
    outside = np.array([-9.3, -4.7, -0.01, 4.01, 6.2, 11.9, 17.3])
    if beyond == "hold":
        expected = np.where(outside < 0, VALUES[0], VALUES[-1])
    elif beyond == "loop":
        expected = inside(outside % 4)
    elif beyond == "pingpong":
        expected = inside(4 - abs(outside % 8 - 4))
    else:
        h = 1e-7
        first = (inside(h) - inside(0.0)) / h
        last = (inside(4 - h) - inside(4 - 2 * h)) / h
        expected = np.where(outside < 0, outside * first, VALUES[-1] + (outside - 4) * last)
    tolerance = 1e-4 if beyond == "extend" else 1e-12
    np.testing.assert_allclose(spline(outside), expected, atol=tolerance, rtol=0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("beyond", ["hold", "loop", "pingpong", "extend"])
def test_the_integral_is_the_integral(kind, beyond):
    """d/dT of the integral is the value: quadrature between breaks is exact to its tolerance."""
    times = [t + 0.25 for t in TIMES]
    spline = spline_of(kind, times, before=beyond, after=beyond)
    cycle = np.array(times)
    mirrored = 0.25 + 4.25 - cycle
    shifts = 4.0 * np.arange(-4, 5)[:, None]
    breaks = np.unique(np.stack([cycle + shifts, mirrored + shifts]))
    for end in (-7.3, -0.1, 0.1, 2.0, 4.25, 5.0, 13.7):
        low, high = min(0, end), max(0, end)
        inner = breaks[(breaks > low) & (breaks < high)]
        edges = [low, *inner, high]
        pieces = [
            quad(spline, a, b, epsabs=1e-11, epsrel=1e-11, limit=200)[0] for a, b in pairwise(edges)
        ]
        assert spline.integral(end) == pytest.approx(np.sign(end) * sum(pieces), abs=1e-9)


RATES = st.lists(st.sampled_from([0.0, 0.0, 0.5, 1.0, 7.0, 1000.0]), min_size=1, max_size=6)
STEPS = st.lists(st.sampled_from([0.01, 0.3, 1.0, 5.0]), min_size=6, max_size=6)


@settings(deadline=None, max_examples=150)
@given(
    rates=RATES,
    steps=STEPS,
    start=st.sampled_from([-2.0, 0.0, 0.7]),
    kind=st.sampled_from(["linear", "constant", "smooth", "monotone"]),
    beyond=st.sampled_from(["hold", "loop", "pingpong"]),
    shares=st.lists(st.floats(0, 1), min_size=1, max_size=8),
)
@example(
    rates=[0.0, 0.0, 7.0, 0.0, 0.5],
    steps=[0.01] * 6,
    start=-2.0,
    kind="linear",
    beyond="loop",
    shares=[1.0],
)
def test_when_inverts_the_integral(rates, steps, start, kind, beyond, shares):
    """integral(when(n)) = n, and just before when(n) the integral is below n."""
    times = start + np.cumsum(steps)[: len(rates)]
    spline = Spline(times, rates, kind, before=beyond, after=beyond)
    total = spline.integral(30.0)
    amounts = total * np.array(shares)
    instants = spline.when(amounts)
    assert (instants >= 0).all()
    # Where the rate begins at 0, an instant is known to the root of rounding, or its third root;
    # a stretch without any rate, at whose begin it is, is ten times longer.
    assert (instants <= 30 + 1e-3).all()
    reached = spline.integral(instants)
    scale = max(total, abs(spline.integral(float(times[0]))), 1e-300)
    assert (abs(reached - amounts) <= 1e-12 * scale).all()
    earlier = instants * (1 - 1e-4)
    assert (spline.integral(earlier) <= amounts + 1e-12 * scale).all()


def test_when_of_a_bezier_rate():
    handles = [[[-0.1, 0], [0.9, 40]], [[-0.9, 30], [0.3, -20]], [[-0.2, 0], [0.1, 0]]]
    spline = Spline([0, 1, 2], [0, 50, 0], "bezier", handles=handles)
    amounts = np.linspace(0, spline.integral(2.0), 1001)
    reached = spline.integral(spline.when(amounts))
    np.testing.assert_allclose(reached, amounts, rtol=1e-12, atol=1e-12 * amounts[-1])


def test_when_knows_never_and_always():
    ends = Spline([0, 1], [2, 0])
    assert ends.when([0, 1, 1.5]).tolist() == [0, 1, np.inf]
    assert Spline([3], [0]).when(1) == np.inf
    assert Spline([3], [4]).when([1, 2, 10]).tolist() == [0.25, 0.5, 2.5]
    growing = Spline([0, 1], [0, 2], after="extend")
    np.testing.assert_allclose(growing.when([0.25, 1, 4, 100]), [0.5, 1, 2, 10], rtol=1e-15)
    with pytest.raises(ValueError, match="must not be negative, but this spline goes down to -1"):
        Spline([0, 1], [0, -1]).when(1)


def test_when_is_the_first_instant_of_a_plateau():
    pulses = Spline([0, 1, 3, 4], [1, 0, 1, 0], "constant", after="loop")
    np.testing.assert_allclose(pulses.when([0.5, 1, 1.5, 2, 2.5, 3]), [0.5, 1, 3.5, 4, 4.5, 5])
    mirrored = Spline([0, 1, 3, 4], [1, 0, 1, 1], "constant", after="pingpong")
    np.testing.assert_allclose(mirrored.when([1, 2, 3, 3.5, 4]), [1, 4, 5, 7.5, 8])


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_hold_and_are_reached(kind):
    spline = spline_of(kind)
    low, high = spline.bounds()
    samples = spline(np.linspace(-1, 5, 200_001))
    assert low <= samples.min() + 1e-14
    assert samples.max() <= high + 1e-14
    assert samples.min() == pytest.approx(low, abs=1e-6)
    assert samples.max() == pytest.approx(high, abs=1e-6)


def test_bounds_of_an_extended_spline_are_infinite_on_the_side_it_leaves_by():
    assert Spline([0, 1], [0, 1], after="extend").bounds() == (0, np.inf)
    assert Spline([0, 1], [0, 1], before="extend").bounds() == (-np.inf, 1)
    assert Spline([0, 1], [1, 1], after="extend").bounds() == (1, 1)


@pytest.mark.parametrize("beyond", ["hold", "loop", "pingpong", "extend"])
@pytest.mark.parametrize("kind", ["linear", "constant", "smooth", "monotone"])
def test_one_key_is_a_constant(kind, beyond):
    spline = Spline([1.0], [3.0], kind, before=beyond, after=beyond)
    assert spline([-5, 1, 9]).tolist() == [3, 3, 3]
    assert spline.integral([-2, 0, 4]).tolist() == [-6, 0, 12]
    assert spline.bounds() == (3, 3)


def test_components_are_scalar_splines_side_by_side():
    columns = np.array([VALUES, VALUES[::-1], np.arange(5.0)]).T
    spline = Spline(TIMES, columns, "smooth", after="loop")
    t = np.linspace(-1, 9, 50).reshape(5, 10)
    assert spline(t).shape == (5, 10, 3)
    for i in range(3):
        alone = Spline(TIMES, columns[:, i], "smooth", after="loop")
        assert (spline(t)[..., i] == alone(t)).all()
        assert (spline.integral(t)[..., i] == alone.integral(t)).all()
        assert (spline.packed()[i] == alone.packed()).all()
        assert tuple(edge[i] for edge in spline.bounds()) == alone.bounds()


def test_inside_another_kernel_a_spline_has_the_same_bits():
    @jit
    def scaled(table, times, out):
        for i in range(times.size):
            out[i] = 2.0 * spline_at(table, times[i])

    times = np.random.default_rng(0).uniform(-3, 9, 5000)
    out = np.empty_like(times)
    for kind in KINDS:
        spline = spline_of(kind, before="pingpong", after="extend")
        scaled(spline.packed(), times, out)
        assert (out == 2 * spline(times)).all()


def test_sampled_is_the_value_at_even_times():
    spline = spline_of("smooth")
    assert (spline.sampled(256) == spline(np.linspace(0, 4, 256))).all()


def test_ten_thousand_keys_are_quick():
    """Finding the segment is logarithmic: a hundred thousand values in a small part of a second."""
    times = np.arange(10_000.0)
    spline = Spline(times, np.sin(times) + 1, "smooth", after="loop")
    at = np.random.default_rng(0).uniform(-10, 20_000, 100_000)
    spline(at[:2])
    began = time.perf_counter()
    spline(at)
    assert time.perf_counter() - began < 1


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (([], []), {}, "at least one key"),
        (([0, 2, 1], [0, 0, 0]), {}, "key 2 is at 2 and key 3 at 1"),
        (([0, 1, 1], [0, 0, 0]), {}, "key 2 is at 1 and key 3 at 1"),
        (([0, 1], [0]), {}, "2 times needs as many values"),
        (([0, np.nan], [0, 1]), {}, "times of a spline must be finite"),
        (([0, 1], [0, np.inf]), {}, "values of a spline must be finite"),
        (([0, 1], [0, 1], "wavy"), {}, '"wavy" is not one of linear, constant'),
        (([0, 1], [0, 1]), {"after": "stop"}, '"stop" is not one of hold, loop'),
        (([0, 1], [0, 1], "bezier"), {}, "needs handles"),
        (([0, 1], [0, 1]), {"handles": np.zeros((2, 2, 2))}, "no other takes them"),
        (([0, 1], [0, 1], "bezier"), {"handles": np.zeros((2, 2))}, r"need shape \(2, 2, 2\)"),
    ],
)
def test_keys_that_make_no_curve_are_refused(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        Spline(*arguments, **options)
