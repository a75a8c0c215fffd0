"""Laws of the fast multipole method: its error against direct sums in double precision."""

from math import factorial, prod

import numpy as np
import pytest
from test_gravity import plummer_sphere

from motes import gravity
from motes.interact.gravity.expansions import folded, terms
from motes.interact.gravity.multipole import Plan, Problem
from motes.interact.gravity.tree import NUMBER, Box, octree
from motes.interact.gravity.upward import summarize


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


def test_single_precision_input_keeps_its_tolerance():
    x, m = plummer_sphere(6000)
    x = x.astype(np.float32)
    exact = gravity.acceleration(x.astype(float), m)
    a = gravity.acceleration(x, m, tolerance=1e-6, method="multipole")
    assert a.dtype == np.float32
    assert relative(a, exact) < 1e-6


@pytest.mark.parametrize(
    ("law", "orders"), [("newton", (2, 3, 5, 9, 12)), ("plummer", (2, 3, 4, 6))]
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
        sums = problem.unsorted(problem.solve(problem.limits(np.inf, np.inf, np.inf)))
        errors.append(relative(sums[:3].T, exact))
    assert np.all(np.diff(np.log(errors)) < -np.log(1.5) * np.diff(orders))
    assert errors[-1] < (1e-6 if law == "newton" else 1e-4)


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
        whole = {
            b: (mass * np.prod(from_center ** np.array(b), axis=1)).sum()
            / prod(factorial(i) for i in b)
            for b in kind.every
        }
        exact = np.array(folded(kind, whole))
        found = tree.moments[cell, : len(exact)]
        np.testing.assert_allclose(found, exact, rtol=1e-10, atol=1e-10 * np.abs(exact).max())


def test_a_tree_holds_every_particle_once():
    x, m = distributions(5000)["two clusters"]
    tree = octree(x, m, box(x), 30)
    assert np.array_equal(np.sort(tree.order), np.arange(5000))
    assert np.array_equal(tree.place[:3], (x - x.min(axis=0))[tree.order].T)
    leaves = tree.cells[tree.cells[:, NUMBER] == 0]
    leaves = leaves[np.argsort(leaves[:, 0])]
    assert leaves[0, 0] == 0
    assert leaves[-1, 1] == 5000
    assert np.array_equal(leaves[1:, 0], leaves[:-1, 1])
    assert (leaves[:, 1] - leaves[:, 0]).max() <= 30
