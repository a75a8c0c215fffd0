"""Laws of gravity: closed forms, symmetry, units, coincidence, and what is refused."""

import math

import numpy as np
import pytest

import motes.jit
from motes import gravity

SPLINE, PLUMMER = {"softening_kernel": "spline"}, {"softening_kernel": "plummer"}


def plummer_sphere(n, seed=0):
    """Equal masses, in sum 1, drawn from (1 + r^2)^(-5/2), of scale radius 1."""
    rng = np.random.default_rng(seed)
    r = 1 / np.sqrt(rng.random(n) ** (-2 / 3) - 1)
    way = rng.normal(size=(n, 3))
    return r[:, None] * way / np.linalg.norm(way, axis=1)[:, None], np.full(n, 1 / n)


def even_plummer_sphere(n):
    """The same with enclosed mass, height and angle evenly spread: a Kronecker sequence."""
    k = np.arange(n)[:, None] + 0.5
    mass, height, turn = (k * 1.2207440846057596 ** -np.array([1.0, 2.0, 3.0]) % 1).T
    r, z, angle = 1 / np.sqrt(mass ** (-2 / 3) - 1), 1 - 2 * height, 2 * math.pi * turn
    flat = np.sqrt(1 - z * z)
    way = np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)
    return r[:, None] * way, np.full(n, 1 / n)


def test_plummers_sphere_has_its_energy_and_force():
    """U = -3 pi / 32, phi = -(1 + r^2)^(-1/2), g = r (1 + r^2)^(-3/2); sampled evenly."""
    x, m = even_plummer_sphere(20_000)
    a, phi = gravity.field(x, m, softening=1e-3, softening_kernel="plummer")
    assert (m * phi).sum() / 2 == pytest.approx(-3 * math.pi / 32, rel=3e-3)
    r = np.linspace(0.3, 3.0, 40)
    way = np.random.default_rng(1).normal(size=(40, 3))
    points = r[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    a, phi = gravity.field(x, m, softening=0.05, targets=points)
    np.testing.assert_allclose(phi, -1 / np.sqrt(1 + r * r), rtol=3e-3)
    inward = -(a * points).sum(axis=1) / r
    assert np.sqrt(np.mean((inward - r / (1 + r * r) ** 1.5) ** 2)) < 5e-3


def test_a_shell_pulls_as_a_point_outside_and_not_inside():
    """Newton's shell theorem, for points spread on a sphere: corrections of order 1/n."""
    x, m = even_plummer_sphere(5000)
    x /= np.linalg.norm(x, axis=1)[:, None]
    points = np.array([[2.0, 0.0, 0.0], [0.0, -3.0, 1.0], [0.1, 0.2, -0.3]])
    a, phi = gravity.field(x, m, targets=points)
    r2 = (points[:2] ** 2).sum(axis=1)
    np.testing.assert_allclose(a[:2], -points[:2] / r2[:, None] ** 1.5, atol=2e-3)
    assert np.abs(a[2]).max() < 5e-3
    assert phi[2] == pytest.approx(-1, rel=2e-3)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("options", [SPLINE, PLUMMER])
@pytest.mark.parametrize("softening", [0.0, 0.1])
def test_action_is_reaction(real, options, softening):
    """sum m a = 0, to the rounding of each a."""
    x, m = plummer_sphere(1000)
    m = m * np.random.default_rng(0).random(1000)
    a = gravity.acceleration(x.astype(real), m, softening=softening, **options).astype(float)
    bound = 4 * np.finfo(real).eps * (m[:, None] * np.abs(a)).sum()
    assert np.abs((m[:, None] * a).sum(axis=0)).max() < bound


@pytest.mark.parametrize("softening", [0.0, 0.2])
@pytest.mark.parametrize("options", [SPLINE, PLUMMER])
def test_acceleration_is_minus_the_gradient_of_the_potential(softening, options):
    """Central differences: error h^2 / 6 of a third derivative, here of order 1 to 100."""
    x, m = plummer_sphere(50)
    points = np.random.default_rng(2).normal(size=(100, 3))
    h = 1e-5
    a = gravity.acceleration(x, m, softening=softening, targets=points, **options)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        phi = [
            gravity.potential(x, m, softening=softening, targets=points + s * step, **options)
            for s in (1, -1)
        ]
        slope = (phi[0] - phi[1]) / (2 * h)
        np.testing.assert_allclose(a[:, axis], -slope, atol=3e-6 * np.abs(a).max())


def test_the_spline_is_newton_beyond_its_support():
    x, m = np.zeros((1, 3)), np.ones(1)
    r = np.array([2.7999, 2.8001, 5.0])
    points = np.stack([r, 0 * r, 0 * r], axis=1)
    soft, hard = (gravity.field(x, m, softening=s, targets=points) for s in (1.0, 0.0))
    np.testing.assert_allclose(soft[0][1:], hard[0][1:], rtol=1e-15)
    np.testing.assert_allclose(soft[1][1:], hard[1][1:], rtol=1e-15)
    np.testing.assert_allclose(soft[0][0], hard[0][0], rtol=1e-8)


def test_the_spline_is_as_deep_as_plummers_law():
    x, m = np.zeros((1, 3)), np.ones(1)
    for options in (SPLINE, PLUMMER):
        phi = gravity.potential(x, m, softening=0.5, targets=np.zeros((1, 3)), **options)
        assert phi[0] == pytest.approx(-2)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("tolerance", [None, 1e-3])
def test_coincident_particles_do_not_pull_each_other(real, tolerance):
    x = np.ones((1000, 3), real)
    options = {"tolerance": tolerance, "method": "direct" if tolerance is None else "multipole"}
    assert not gravity.acceleration(x, np.ones(1000), **options).any()
    assert not gravity.potential(x, np.ones(1000), **options).any()
    phi = gravity.potential(x, np.ones(1000), softening=0.5, **options)
    np.testing.assert_allclose(phi, -999 / 0.5, rtol=1e-6)


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("tolerance", [None, 1e-4, 1e-3])
@pytest.mark.parametrize(("length", "mass"), [(3e20, 2e30), (1e-12, 1e-25), (1.0, 1e33)])
def test_units_do_not_matter(real, tolerance, length, mass):
    """a scales as mass / length^2, in units where squares and cubes leave single precision."""
    x, m = plummer_sphere(200)
    options = {"tolerance": tolerance, "method": "direct" if tolerance is None else "multipole"}
    a = gravity.acceleration(x.astype(real), m, **options)
    G = length**2 / mass
    scaled = gravity.acceleration(real(length) * x.astype(real), mass * m, G=G, **options)
    # From a tolerance of 1e-3 on, pairs are rough, and roughness depends on a number's digits.
    least = 5e-4 if tolerance == 1e-3 else 2e-5
    np.testing.assert_allclose(scaled, a, rtol=1e-3, atol=least * np.abs(a).max())


def test_close_pairs_far_from_the_origin_keep_their_distance():
    """Single precision: differences of near coordinates are exact."""
    x = np.array([[100.0, 0, 0], [100.0 + 2.0**-14, 0, 0], [-100.0, 0, 0]], np.float32)
    a = gravity.acceleration(x, np.array([1.0, 1.0, 0.0]))
    assert a[0, 0] == pytest.approx(2.0**28, rel=1e-6)


@pytest.mark.parametrize("tolerance", [None, 1e-4])
def test_results_do_not_depend_on_the_number_of_threads(tolerance):
    x, m = plummer_sphere(5000)
    before = motes.jit.threads()
    results = []
    try:
        for count in (1, 2, 4):
            motes.jit.threads(count)
            method = "multipole" if tolerance else "direct"
            results.append(gravity.acceleration(x, m, tolerance=tolerance, method=method))
    finally:
        motes.jit.threads(before)
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("tolerance", [None, 1e-5])
def test_one_two_and_three_bodies(real, tolerance):
    """m / r^2 and m / r by hand: alone, side by side, and at the corners of an even triangle."""
    options = {"tolerance": tolerance, "method": "direct" if tolerance is None else "multipole"}
    x = np.array([[0, 0, 0], [2, 0, 0], [1, math.sqrt(3), 0]], real)
    a, phi = gravity.field(x[:1], np.ones(1), **options)
    assert not a.any()
    assert not phi.any()
    a, phi = gravity.field(x[:2], np.array([1.0, 4.0]), **options)
    np.testing.assert_allclose(a, [[1, 0, 0], [-0.25, 0, 0]], rtol=2e-6)
    np.testing.assert_allclose(phi, [-2, -0.5], rtol=2e-6)
    a, phi = gravity.field(x, np.ones(3), **options)
    center = x.mean(axis=0)
    pull = 2 * math.cos(math.pi / 6) / 4
    np.testing.assert_allclose(a, pull * (center - x) * math.sqrt(3) / 2, rtol=2e-6, atol=1e-6)
    np.testing.assert_allclose(phi, -1, rtol=2e-6)


def test_nothing_is_pulled_by_nothing():
    none = np.zeros((0, 3))
    assert gravity.acceleration(none, np.zeros(0)).shape == (0, 3)
    assert gravity.acceleration(none, np.zeros(0), tolerance=1e-3).shape == (0, 3)
    a, phi = gravity.field(np.ones((2, 3)), np.zeros(2), targets=np.zeros((1, 3)))
    assert not a.any()
    assert not phi.any()


X, M = np.zeros((3, 3)), np.ones(3)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((np.zeros((3, 2)), M), {}, r"x must have the shape \(n, 3\), not \(3, 2\)"),
        ((X * 1j, M), {}, "x must be real numbers, not complex128"),
        ((X, np.ones(4)), {}, r"m must have the shape \(3,\)"),
        ((X * np.nan, M), {}, r"x\[0, 0\] = nan; all values must be finite"),
        ((X, -M), {}, r"m\[0\] = -1; masses must be at least 0"),
        ((X, M), {"softening": -1.0}, "softening = -1 must be a finite number of at least 0"),
        ((X, M), {"G": math.inf}, "G = inf must be a finite number"),
        (
            (X, M),
            {"method": "multipol"},
            'none of auto, direct, multipole. Did you mean "multipole"',
        ),
        ((X, M), {"softening_kernel": "gauss"}, "'gauss' is none of spline, plummer"),
        ((X, M), {"method": "multipole"}, "needs a tolerance"),
        ((X, M), {"tolerance": 1.0}, "tolerance = 1 must be below 1"),
        ((X, M), {"tolerance": 1e-11}, "at least 1e-10 for positions in double precision"),
        ((X.astype(np.float32), M), {"tolerance": 1e-7}, "at least 1e-06 .* give x as float64"),
        ((X, M), {"tolerance": "small"}, "tolerance must be a number, not 'small'"),
        ((np.diag([0.0, 0.0, 1e200]), M), {}, "x spans .*; it must be below 1e.150"),
        ((X, M), {"targets": np.zeros(3)}, "targets must have the shape"),
    ],
)
def test_bad_input_is_named(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        gravity.acceleration(*arguments, **options)
