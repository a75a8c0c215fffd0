"""Trees that one sum leaves for the next: errors stay below the tolerance while they are used."""

import numpy as np
import pytest
from test_gravity_multipole import distributions, relative

import motes
from motes import gravity, neighbours
from motes.interact.gravity.trees import SUMS

NAMES = ["uniform", "plummer", "two clusters", "disc", "masses over 1e12"]


def sums_of(trees):
    return trees.kept.sums


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-7])
def test_the_error_is_below_the_tolerance_while_particles_move(name, tolerance):
    x, m = distributions(4000)[name]
    rng, trees, used = np.random.default_rng(1), gravity.Trees(), 0
    _, away = neighbours.nearest(x, 16)
    way = 0.03 * away[:, -1:]
    for _ in range(20):
        x = x + way * rng.uniform(-1, 1, x.shape)
        a = gravity.acceleration(x, m, tolerance=tolerance, method="multipole", trees=trees)
        used += sums_of(trees) > 1
        assert relative(a, gravity.acceleration(x, m)) < tolerance
    assert used > 5


def test_a_sum_at_the_same_places_has_the_same_bits_however_often():
    x, m = distributions(3000)["plummer"]
    options = {"tolerance": 1e-3, "method": "multipole"}
    alone, trees = gravity.acceleration(x, m, **options), gravity.Trees()
    counts = []
    for _ in range(SUMS + 2):
        assert np.array_equal(gravity.acceleration(x, m, trees=trees, **options), alone)
        counts.append(sums_of(trees))
    assert counts == [*range(1, SUMS + 1), 1, 2]


def test_other_targets_keep_trees_of_their_own():
    x, m = distributions(3000)["plummer"]
    targets, trees = x[:1000] + 0.01, gravity.Trees()
    for _ in range(3):
        options = {"targets": targets, "tolerance": 1e-4, "method": "multipole"}
        a, phi = gravity.field(x, m, trees=trees, **options)
        exact, deep = gravity.field(x, m, targets=targets)
        assert relative(a, exact) < 1e-4
        assert relative(phi, deep) < 1e-4
        x, targets = x * 1.001, targets * 0.999
    assert sums_of(trees) == 3


@pytest.mark.parametrize(
    "change",
    [
        lambda x, m: (x[:-1], m[:-1]),
        lambda x, m: (x * [1.0, 1.0, 1.6], m),
        lambda x, m: (x[::-1], m),
        lambda x, m: (x, 0.7 * m),
    ],
    ids=["other numbers", "stretched", "other order", "lighter"],
)
def test_what_is_no_longer_so_is_made_anew(change):
    x, m = distributions(3000)["plummer"]
    m, trees = 1.9 * m, gravity.Trees()  # And 1.9 * 0.7 are measured in the same unit.
    gravity.acceleration(x, m, tolerance=1e-3, method="multipole", trees=trees)
    x, m = change(x, m)
    a = gravity.acceleration(x, m, tolerance=1e-3, method="multipole", trees=trees)
    assert sums_of(trees) == 1
    assert np.array_equal(a, gravity.acceleration(x, m, tolerance=1e-3, method="multipole"))


def test_a_copy_knows_the_same_and_goes_its_own_way():
    x, m = distributions(3000)["plummer"]
    options, trees = {"tolerance": 1e-3, "method": "multipole"}, gravity.Trees()
    gravity.acceleration(x, m, trees=trees, **options)
    other = trees.copy()
    gravity.acceleration(x, m, trees=other, **options)
    assert (sums_of(trees), sums_of(other)) == (1, 2)


def run(steps, look):
    """A Plummer sphere's simulation after some steps, looked at within each of them or not."""
    stars = motes.emit.Plummer(burst=[{"count": 16_000}], mu=1.0)
    simulation = motes.Simulation(
        motes.Scene(
            systems=[motes.System("stars", emit=[stars], mass=1 / 16_000)],
            interact=[motes.interact.Gravity(G=1.0, softening=0.05, tolerance=1e-3)],
            step=0.01,
            integrator="leapfrog",
        )
    )
    for _ in range(steps):
        simulation.step()
        if look:
            simulation.frame(simulation.time + 0.004)
    return simulation


def test_who_looks_at_a_scene_between_steps_changes_no_bit_of_it():
    """Trees are part of what lasts from step to step, and a look uses a copy of its own."""
    assert run(6, look=True).digest() == run(6, look=False).digest()


def test_a_scene_uses_trees_again_and_knows_them_in_its_digest():
    simulation = run(4, look=False)
    (memory,) = simulation._state.memories
    (trees,) = memory.trees.values()
    assert sums_of(trees) == 5
    digest = simulation.digest()
    memory.trees.clear()
    assert simulation.digest() != digest
