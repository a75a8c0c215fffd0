"""Laws of pairs in single precision: rough ones, with the processor's estimate of 1 / r, and fine
ones, with coordinates in two parts."""

import numpy as np
import pytest
from test_gravity import plummer_sphere
from test_gravity_multipole import box, distributions, relative

from motes import gravity
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.multipole import Problem
from motes.interact.gravity.pairs import RUN, attraction
from motes.interact.gravity.plan import MIXED_FROM, SINGLE_FROM, plan, plans
from motes.interact.gravity.softening import ROUGH, SUPPORT


@pytest.mark.parametrize("n", [3000, 20_000])
def test_rough_pairs_of_large_forces_that_cancel_are_seen(n):
    """Next to each particle of a line, two pull it apart with a thousand times what is left."""
    x, m = distributions(n)["line of equal steps"]
    x = x.astype(np.float32)
    exact = gravity.acceleration(x.astype(np.float64), m)
    a = gravity.acceleration(x, m, tolerance=1e-3, method="multipole")
    assert relative(a, exact) < 1e-3
    rough, fine, double = plans(1e-3, "newton")
    assert (rough.rough, fine.rough, double.rough) == (True, False, False)
    assert (fine.real, double.real) == (np.float32, np.float64)
    assert [p.rough for p in plans(9e-4, "newton")] == [False, False]


@pytest.mark.parametrize("rough", [True, False])
def test_pairs_are_as_wrong_as_they_say(rough):
    """Pulls of single sources at distances over six decades."""
    attract = attraction("newton", np.float32, True, rough=rough)
    n = 4000
    r = np.float32(10) ** np.random.default_rng(2).uniform(-3, 3, n).astype(np.float32)
    source, out = np.zeros((4, LANES), np.float32), np.zeros((5, n), np.float32)
    source[0, 1:], source[3, 0] = 1e6, 1.0
    target = np.zeros((3, n), np.float32)
    target[0] = r
    attract(target, n, source, LANES, (0, 0, 0), np.float32(0), out)
    wrong = -out[0] * r.astype(np.float64) ** 2 - 1
    deep = out[4] * r.astype(np.float64) - 1
    for error, part in ((wrong, 1.0), (deep, 1 / 3)):
        assert np.sqrt((error**2).mean()) < part * (1.1 * ROUGH if rough else 4e-7)


@pytest.mark.parametrize(("law", "softening"), [("newton", 0), ("plummer", 1e-6), ("spline", 1e-6)])
def test_coordinates_in_two_parts_tell_neighbours_that_are_very_close(law, softening):
    """Pulls over a millionth of the coordinates, whose difference one part would not know."""
    rng, size = np.random.default_rng(4), softening * (SUPPORT if law == "spline" else 1)
    attract = attraction(law, np.float32, True, bound=True, fine=True)
    kernel = {
        "softening": softening,
        "softening_kernel": "plummer" if law == "plummer" else "spline",
    }
    for _ in range(100):
        x = rng.uniform(-1, 1, (1, 3))
        other = x + rng.normal(size=3) * 10.0 ** rng.uniform(-7, -5)
        source, target = np.zeros((7, LANES), np.float32), np.zeros((6, 1), np.float32)
        source[0], source[3, 0], out = 1e6, 1.0, np.zeros((5, 1))
        for row in range(3):
            source[row, 0], target[row, 0] = other[0, row], x[0, row]
            source[4 + row, 0] = other[0, row] - float(source[row, 0])
            target[3 + row, 0] = x[0, row] - float(target[row, 0])
        attract(target, 1, source, LANES, (0, 0, 0), np.float32(size), out)
        exact, deep = gravity.field(other, [1.0], targets=x, **kernel)
        assert relative(out[:3, 0], exact[0]) < 5e-7
        assert abs(-out[4, 0] / deep[0] - 1) < 5e-7


def test_many_fine_pairs_lose_no_more_than_one():
    """Errors of single pulls add up at random, and the sum itself adds little to them."""
    rng, n = np.random.default_rng(5), 4 * RUN
    source, target = np.zeros((7, n), np.float32), np.zeros((6, 50), np.float32)
    source[:3], target[:3], source[3] = rng.random((3, n)), rng.random((3, 50)), 1.0
    d = source[:3, None].astype(float) - target[:3, :, None]
    pulls = d / (d**2).sum(axis=0) ** 1.5
    root = np.sqrt((pulls**2).sum(axis=(0, 2)))
    errors = {}
    for fine in (False, True):
        out = np.zeros((5, 50))
        attract = attraction("newton", np.float32, False, fine=fine)
        attract(target, 50, source, n, (0, 0, 0), np.float32(0), out)
        wrong = (out[:3] - pulls.sum(axis=2)) / root
        errors[fine] = np.sqrt((wrong**2).sum(axis=0).mean())
    assert errors[True] < 2e-7 < 1.5 * errors[False]


def test_pulls_in_single_precision_are_right_on_average():
    """A factor that single precision does not hold would make all of them too small."""
    rng, n = np.random.default_rng(6), 32 * RUN
    source, target = np.zeros((7, n), np.float32), np.zeros((6, 1), np.float32)
    source[0], source[3] = rng.uniform(1, 2, n), 1.0
    exact = (1 / source[0].astype(float) ** 2).sum()
    attract, found = attraction("newton", np.float32, False, fine=True), np.zeros((5, 1))
    attract(target, 1, source, n, (0, 0, 0), np.float32(0), found)
    assert abs(found[0, 0] / exact - 1) < 2e-8


def test_the_spline_is_as_exact_in_single_precision_as_other_laws():
    """Close to its support, too, where powers of the distance would nearly cancel."""
    n, softening = 40 * LANES, 0.1
    target = np.zeros((3, n), np.float32)
    target[0] = SUPPORT * softening * np.linspace(0.05, 1.01, n)
    source, out = np.zeros((4, LANES), np.float32), np.zeros((5, n))
    source[0, 1:], source[3, 0] = 1e6, 1.0
    size = np.float32(SUPPORT * softening)
    attraction("spline", np.float32, True)(target, n, source, LANES, (0, 0, 0), size, out)
    points = target.T.astype(float)
    exact, deep = gravity.field([[0, 0, 0]], [1], targets=points, softening=float(size) / SUPPORT)
    assert np.abs(out[0] / exact[:, 0] - 1).max() < 1e-6
    assert np.abs(-out[4] / deep - 1).max() < 1e-6


@pytest.mark.parametrize("tolerance", [MIXED_FROM, 1e-7, 0.99 * SINGLE_FROM])
@pytest.mark.parametrize("name", ["uniform", "plummer", "disc"])
def test_a_mixture_of_both_precisions_keeps_its_tolerances(name, tolerance):
    """Without sums that are formed again in double precision throughout."""
    x, m = distributions(12_000)[name]
    first = plan(tolerance, "newton")
    assert first.mixed
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, True, first)
    limits = problem.limits_for(tolerance)
    assert limits is not None
    a, phi = problem.unsorted(problem.solve(limits))
    rows = slice(None, None, 10)
    exact, deep = gravity.field(x, m, targets=x[rows])
    assert relative(a[rows], exact) < tolerance
    assert relative(phi[rows], -deep) < tolerance


@pytest.mark.parametrize("tolerance", [MIXED_FROM, 1e-7])
def test_one_close_pair_that_pulls_most_is_summed_in_double_precision(tolerance):
    """Its pull is a hundred times all others, and single precision would spoil the mean of all."""
    x, m = plummer_sphere(6000)
    x[1] = x[0] + 1e-5
    exact = gravity.acceleration(x, m)
    assert np.linalg.norm(exact[0]) > 100 * np.median(np.linalg.norm(exact, axis=1))
    a = gravity.acceleration(x, m, tolerance=tolerance, method="multipole")
    assert relative(a, exact) < tolerance


@pytest.mark.parametrize("name", ["uniform", "plummer", "masses over 1e12"])
def test_the_sample_of_a_mixture_is_compared_with_pairs_in_double_precision(name, monkeypatch):
    """Those in single precision would have the same errors as what is judged."""
    x, m = distributions(12_000)[name]
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, False, plan(1e-7, "newton"))
    compared = []
    monkeypatch.setattr(
        Problem, "_error", lambda self, sample, tried, exact: compared.append((sample, exact)) or 0
    )
    problem.limits_for(MIXED_FROM)
    sample, found = compared[0]
    exact = gravity.acceleration(x, m, targets=x[problem.targets.order[sample.rows]])
    assert relative(found[:3].T, exact) < 0.1 * MIXED_FROM


def test_pulls_of_far_cells_are_in_double_precision_in_a_mixture():
    """Where expansions neglect next to nothing, what is left is the rounding of pairs."""
    x, m = distributions(30_000)["uniform"]
    rows = slice(None, None, 60)
    exact, deep = gravity.field(x, m, targets=x[rows])
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, True, plan(1e-7, "newton"))
    scale = np.sqrt((exact**2).sum(axis=1).mean())
    limits = problem.limits(5e-9 * scale, np.inf, np.inf, 3e-8 * scale)
    a, phi = problem.unsorted(problem.solve(limits))
    assert relative(a[rows], exact) < 1.5e-8
    assert relative(phi[rows], -deep) < 1e-8


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_very_light_particles_may_be_very_close(tolerance):
    """Closer than single precision has powers of distances, or at one place."""
    rng = np.random.default_rng(7)
    x, m = rng.random((3000, 3)), np.full(3000, 1 / 3000)
    x[:200] = x[200:400] + 1e-14 * rng.normal(size=(200, 3))
    m[:400] = 1e-29
    first = plan(tolerance, "newton")
    problem = Problem.build(x, m, None, box(x), "newton", 0.0, False, first)
    limits = problem.limits_for(tolerance)
    assert limits is not None
    assert np.isfinite(limits).all()
    a, _ = problem.unsorted(problem.solve(limits))
    assert relative(a, gravity.acceleration(x, m)) < tolerance
