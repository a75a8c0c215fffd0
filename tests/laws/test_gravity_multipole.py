"""Laws of the fast multipole method: its error against direct sums in double precision."""

import math
from math import factorial, prod

import numpy as np
import pytest
from test_gravity import plummer_sphere

from motes import gravity
from motes.interact.gravity.acceptance import acceptance, seen
from motes.interact.gravity.expansions import folded, terms
from motes.interact.gravity.lanes import LANES, write
from motes.interact.gravity.multipole import Problem
from motes.interact.gravity.plan import Plan, plan
from motes.interact.gravity.sample import Sample, sample_of
from motes.interact.gravity.tree import NUMBER, SPREAD, Box, octree
from motes.interact.gravity.upward import MANY, summarize
from motes.jit import jit
from motes.machine.lanes import choose


def distributions(n):
    """Positions and masses that are hard in different ways."""
    rng = np.random.default_rng(3)
    equal = np.full(n, 1 / n)
    sphere, _ = plummer_sphere(n)
    disc = rng.normal(size=(n, 3)) * rng.exponential(size=(n, 1)) * [1, 1, 0.01]
    clusters = sphere * 0.01 + np.where(np.arange(n) % 2, 1.0, -1.0)[:, None]
    line = np.zeros((n, 3))
    line[:, 0] = rng.random(n)
    coincident = np.ones((n, 3))
    coincident[0] = 3.0
    return {
        "uniform": (rng.random((n, 3)), equal),
        "plummer": (sphere, equal),
        "two clusters": (clusters, equal),
        "disc": (disc, equal),
        "line": (line, equal),
        "line of equal steps": (np.linspace(0, 1, n)[:, None] * [1.0, 0.5, 0.0], equal),
        "all coincident but one": (coincident, equal),
        "masses over 1e12": (sphere, 10.0 ** rng.uniform(-12, 0, n)),
        "one sun": (sphere, np.where(np.arange(n) == 7, 1.0, 1e-12)),
        "massless but few": (sphere, np.where(np.arange(n) % 100, 0.0, 1.0)),
        "far from the origin": (sphere + 1e6, equal),
    }


NAMES = list(distributions(1))


def box(x):
    return Box(x.min(axis=0), float(np.ptp(x, axis=0).max()), 1.0)


def relative(wrong, exact):
    return np.sqrt(((wrong - exact) ** 2).sum() / (exact**2).sum())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-5, 1e-8])
def test_the_error_is_below_the_tolerance(name, tolerance):
    x, m = distributions(6000)[name]
    exact, deep = gravity.field(x, m)
    a, phi = gravity.field(x, m, tolerance=tolerance, method="multipole")
    assert relative(a, exact) < tolerance
    assert relative(phi, deep) < tolerance
    total = (m[:, None] * a).sum(axis=0)
    assert np.abs(total).max() < tolerance * (m[:, None] * np.abs(a)).sum()


@pytest.mark.parametrize("name", NAMES)
def test_a_tolerance_near_rounding_is_kept(name):
    """Beyond the highest order, expansions are used farther away only."""
    x, m = distributions(6000)[name]
    exact, deep = gravity.field(x, m)
    a, phi = gravity.field(x, m, tolerance=1e-10, method="multipole")
    assert relative(a, exact) < 1e-10
    assert relative(phi, deep) < 1e-10


@pytest.mark.parametrize("off", [0.0, 0.4, 1.7, -0.5, -3.0, 1e4])
def test_close_pairs_lose_nothing_by_the_unit_of_length(off):
    """Their accelerations hang on the last bits of coordinates, wherever the origin is."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-1, 1, (3000, 3)) + off
    x[:100] = x[100:200] + rng.normal(0, 3e-7, (100, 3))
    m = np.full(3000, 1 / 3000)
    exact = gravity.acceleration(x, m)
    assert relative(gravity.acceleration(x, m, tolerance=1e-10, method="multipole"), exact) < 1e-11


def test_large_forces_that_cancel_are_summed_in_double_precision():
    """On a lattice the rounding of pairs in single precision adds up to a pull on the whole."""
    x, m = distributions(60_000)["line of equal steps"]
    a = gravity.acceleration(x, m, tolerance=1e-4, method="multipole")
    total = (m[:, None] * a).sum(axis=0)
    assert np.abs(total).max() < 1e-4 * (m[:, None] * np.abs(a)).sum()


@pytest.mark.parametrize("kernel", ["spline", "plummer"])
def test_a_pile_at_one_place_feels_what_one_particle_there_feels(kernel):
    """Its particles do not pull each other, however deep they soften."""
    rng = np.random.default_rng(1)
    x = np.concatenate([np.tile(rng.normal(size=3), (75, 1)), rng.normal(size=(100, 3))])
    m, options = np.full(175, 1 / 175), {"softening": 0.02, "softening_kernel": kernel}
    one = gravity.acceleration(x[75:], m[75:], targets=x[:1], **options)
    a = gravity.acceleration(x, m, tolerance=1e-10, method="multipole", **options)
    assert relative(a[:75], one) < 1e-14


def test_a_pile_of_many_is_in_the_sample():
    rng = np.random.default_rng(1)
    x = np.concatenate([rng.normal(size=(18_000, 3)), np.tile([0.3, 0.2, 0.1], (2_000, 1))])
    m = np.full(20_000, 1 / 20_000)
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, False, plan(1e-3, "newton"))
    sample = sample_of(problem.targets)
    places, pile = problem.targets.place[:3, sample.rows].T, x[-1] - box(x).origin
    at_the_pile = (places == pile).all(axis=1)
    assert at_the_pile.sum() == 2_000
    np.testing.assert_allclose(sample.weight[at_the_pile], 1.0)


def test_large_values_count_as_four_times_what_is_usual():
    """Fifteen sixteenths are 1 and the rest a thousand, which count as 4 times 15/16."""
    n = 1600
    sample = Sample(*[np.zeros((0, 2), np.int64)] * 2, np.ones(n), *[np.zeros(0, np.intp)] * 2)
    values = np.where(np.arange(n) % 16, 1.0, 1000.0)
    assert sample.mean_of_most(values) == pytest.approx((15 + 4 * 15 / 16) / 16, rel=1e-12)
    assert sample.mean_of_most(np.zeros(n)) == 0.0


def test_the_sample_sees_a_pull_on_the_whole():
    """Where one in five is pulled, an error of the total is more than the rms error shows."""
    x, m = plummer_sphere(4000)
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, False, plan(1e-3, "newton"))
    sample = sample_of(problem.targets)
    rng = np.random.default_rng(4)
    n = len(sample.rows)
    exact = rng.normal(size=(3, n)) * np.where(rng.random(n) < 0.8, 1e-3, 1.0)
    bias = np.array([[0.01], [0.0], [0.0]])
    pulled = sample.weight * problem.targets.place[3, sample.rows]
    drift = 0.01 * pulled.sum() / (pulled * np.linalg.norm(exact, axis=0)).sum()
    assert sample.relative(np.full(n, 0.01), np.linalg.norm(exact, axis=0), 0.0) < drift
    np.testing.assert_allclose(problem._error(sample, exact + bias, exact), drift, rtol=1e-6)


def test_accelerations_beyond_single_precision_are_told():
    x, m = plummer_sphere(2000)
    with pytest.warns(RuntimeWarning, match="overflow"):
        gravity.acceleration(x.astype(np.float32), m, G=1e39, tolerance=1e-3, method="multipole")


@pytest.mark.parametrize("name", ["uniform", "plummer", "two clusters", "disc"])
@pytest.mark.parametrize("kernel", ["spline", "plummer"])
@pytest.mark.parametrize("softening", [0.01, 0.5])
def test_softened_sums_agree(name, kernel, softening):
    x, m = distributions(6000)[name]
    options = {"softening": softening, "softening_kernel": kernel}
    exact, deep = gravity.field(x, m, **options)
    for tolerance in (1e-3, 1e-6):
        a, phi = gravity.field(x, m, tolerance=tolerance, method="multipole", **options)
        assert relative(a, exact) < tolerance
        assert relative(phi, deep) < tolerance


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_other_targets_feel_the_same_field(tolerance):
    x, m = plummer_sphere(5000)
    targets = np.concatenate([2 * np.random.default_rng(5).random((3000, 3)), x[:10]])
    exact, deep = gravity.field(x, m, targets=targets)
    a, phi = gravity.field(x, m, targets=targets, tolerance=tolerance, method="multipole")
    assert relative(a, exact) < tolerance
    assert relative(phi, deep) < tolerance


@pytest.mark.parametrize(
    ("name", "n", "kernel", "softening", "tolerance"),
    [
        ("massless but few", 1000, "spline", 0.3, 1e-8),
        ("massless but few", 1000, "plummer", 0.5, 1e-6),
        ("one sun", 6000, "plummer", 0.5, 1e-8),
        ("masses over 1e12", 6000, "spline", 0.3, 1e-5),
        ("uniform", 1000, "plummer", 0.5, 1e-1),
    ],
)
def test_single_large_errors_are_seen(name, n, kernel, softening, tolerance):
    """Where the sample of leaves tells least about the others, or expansions converge slowly."""
    x, m = distributions(n)[name]
    options = {"softening": softening, "softening_kernel": kernel}
    exact, deep = gravity.field(x, m, **options)
    a, phi = gravity.field(x, m, tolerance=tolerance, method="multipole", **options)
    assert relative(a, exact) < tolerance
    assert relative(phi, deep) < tolerance
    total = (m[:, None] * a).sum(axis=0)
    assert np.abs(total).max() < tolerance * (m[:, None] * np.abs(a)).sum()


def test_single_precision_input_keeps_its_tolerance():
    x, m = plummer_sphere(6000)
    x = x.astype(np.float32)
    exact = gravity.acceleration(x.astype(float), m)
    a = gravity.acceleration(x, m, tolerance=1e-6, method="multipole")
    assert a.dtype == np.float32
    assert relative(a, exact) < 1e-6


@pytest.mark.parametrize(
    ("law", "orders"), [("newton", (2, 3, 5, 9, 12, 14)), ("plummer", (2, 3, 4, 6))]
)
def test_the_error_falls_with_the_order(law, orders):
    """At a fixed opening of 1/2 each order divides the error by more than 1.5."""
    x, m = plummer_sphere(3000)
    size = 0.05 if law == "plummer" else 0.0
    exact = gravity.acceleration(x, m, softening=size, softening_kernel="plummer")
    errors = []
    for order in orders:
        plan = Plan(order=order, low=order, leaf=16, real=np.float64, opening=0.5)
        problem = Problem.build(x, m, None, box(x), law, size, True, plan)
        sums, _ = problem.unsorted(problem.solve(problem.limits(np.inf, np.inf, np.inf, np.inf)))
        errors.append(relative(sums, exact))
    assert np.all(np.diff(np.log(errors)) < -np.log(1.5) * np.diff(orders))
    assert errors[-1] < (1e-6 if law == "newton" else 1e-4)


@pytest.mark.parametrize("name", ["plummer", "two clusters"])
@pytest.mark.parametrize("order", [3, 5, 8, 11])
def test_errors_are_the_same_part_of_what_one_expansion_may_neglect(name, order):
    """All add up to some 0.1 to 0.5 of what one may neglect, from 0.35 to 2e-7 of the field."""
    x, m = distributions(6000)[name]
    exact = gravity.acceleration(x, m)
    allowed = 5 * 10.0 ** (-(order - 1.5) / 1.3)
    plan = Plan(order=order, low=order - 2, leaf=32, real=np.float64)
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, False, plan)
    scale = np.sqrt((exact**2).sum(axis=1).mean())
    sums, _ = problem.unsorted(problem.solve(problem.limits(allowed * scale, np.inf, np.inf, 0.0)))
    ratio = relative(sums, exact) / allowed
    assert 0.08 < ratio < 0.6


def far(distance, opening=1.0, reach=0.0, error=np.inf, softening=0.0, order=6):
    """Whether a ball of radius 0.3, mass 2 and spread 0.2 is far from one of radius 0.5."""
    own = np.array([0.1, 0.2, 0.3, 0, 0, 0, 0.5, 0.5])
    balls, found = np.zeros((LANES, 16)), np.zeros((2, LANES))
    balls[:, 0], balls[:, 6], balls[:, 7], balls[:, 8] = 5.0, 0.3, 0.2, 2.0
    balls[1, :3] = own[:3] + distance * np.array([2, 1, -2]) / 3
    is_far, chosen = acceptance(order, order - 2, np.float64), np.arange(LANES, dtype=np.int32)

    @jit(numba=False)
    def test(balls, chosen, own, stricter, opening2, reach, e2, found):
        full, easy = is_far(seen(balls, chosen), own, stricter, opening2, reach, e2)
        write(found[0], 0, choose(full, 1.0, 0.0))
        write(found[1], 0, choose(easy, 1.0, 0.0))

    stricter = (1 / error, 8 / error)
    test(balls, chosen, own, stricter, opening**2, reach, softening**2, found)
    return tuple(found[:, 1] > 0)


@pytest.mark.parametrize("off", [-1e-6, 1e-6])
def test_cells_are_far_beyond_the_opening_the_reach_and_the_error(off):
    yes = off > 0
    assert far(0.8 + off)[0] == yes
    assert far(1.6 + off, opening=0.5)[0] == yes
    assert far(0.8 + 0.7 + off, reach=0.7)[0] == yes
    assert far(math.sqrt(0.8**2 - 0.6**2) + off, softening=0.6)[0] == yes
    for p, which in ((6, 0), (4, 1)):
        for e in (0.0, 0.6):
            r = math.sqrt(1.7**2 + e * e)
            crowd = (0.5**2 / (0.3**2 + 0.1 * 0.5**2)) ** 2
            error = crowd * 2 / r**2 * (0.7 / r) ** p / (1 - (0.8 / r) ** 2) * (1, 8)[which]
            assert far(1.7, error=error * (1 + off), softening=e)[which] == yes


@pytest.mark.parametrize("harmonic", [True, False])
def test_moments_of_every_cell_are_the_sums_over_its_particles(harmonic):
    """M_b = sum m (-s)^b / (b! h^|b|), shifted from children to parents or summed here."""
    x, m = plummer_sphere(500)
    kind = terms(6, harmonic)
    tree = summarize(octree(x, m, box(x), 20), 6, harmonic, np.float64, True)
    for cell, (start, end) in enumerate(tree.cells[:, :2]):
        center, radius = tree.bodies[cell, :3], tree.bodies[cell, 3]
        inside, mass = tree.place[:3, start:end].T, tree.place[3, start:end]
        np.testing.assert_allclose(center, np.average(inside, axis=0, weights=mass))
        from_center = (center - inside) / max(radius, 1e-12)
        np.testing.assert_allclose(np.linalg.norm(from_center, axis=1).max(), radius > 0)
        spread = np.average(np.linalg.norm(center - inside, axis=1) ** 6, weights=mass) ** (1 / 6)
        np.testing.assert_allclose(tree.balls[cell, SPREAD], spread, rtol=1e-12)
        whole = {
            b: (mass * np.prod(from_center ** np.array(b), axis=1)).sum()
            / prod(factorial(i) for i in b)
            for b in kind.every
        }
        exact = np.array(folded(kind, whole))
        found = tree.moments[cell, : len(exact)]
        np.testing.assert_allclose(found, exact, rtol=1e-10, atol=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("exponent", [-1030, 900])
def test_masses_may_be_near_the_ends_of_the_numbers(exponent):
    x, m = plummer_sphere(500)
    exact, unit = gravity.acceleration(x, m), 2.0**exponent
    a = gravity.acceleration(x, m * unit, tolerance=1e-3, method="multipole")
    assert relative(a / unit, exact) < 1e-3


@pytest.mark.parametrize("name", ["plummer", "two clusters"])
def test_balls_of_large_cells_hold_all_that_is_in_them(name):
    """Radius and spread of a cell of many particles are its own or somewhat larger."""
    x, m = distributions(9000)[name]
    tree = summarize(octree(x, m, box(x), 20), 6, True, np.float64, True)
    large = np.flatnonzero(tree.cells[:, 1] - tree.cells[:, 0] > MANY)
    assert len(large) > 5
    for cell in large:
        start, end = tree.cells[cell, :2]
        away = np.linalg.norm(tree.place[:3, start:end].T - tree.bodies[cell, :3], axis=1)
        spread = np.average(away**6, weights=tree.place[3, start:end]) ** (1 / 6)
        assert 1 - 1e-12 < tree.bodies[cell, 3] / away.max() < 1.5
        assert 1 - 1e-12 < tree.balls[cell, SPREAD] / spread < 1.5


def test_a_tree_holds_every_particle_once():
    x, m = distributions(5000)["two clusters"]
    tree = octree(x, m, box(x), 30)
    assert np.array_equal(np.sort(tree.order), np.arange(5000))
    assert np.array_equal(tree.place[:3], (x - box(x).origin)[tree.order].T)
    leaves = tree.cells[tree.cells[:, NUMBER] == 0]
    leaves = leaves[np.argsort(leaves[:, 0])]
    assert leaves[0, 0] == 0
    assert leaves[-1, 1] == 5000
    assert np.array_equal(leaves[1:, 0], leaves[:-1, 1])
    assert (leaves[:, 1] - leaves[:, 0]).max() <= 30
