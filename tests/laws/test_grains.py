"""Laws of spheres that collide: whoever works on them, and in whichever order."""

from __future__ import annotations

import numpy as np
import pytest

import motes
from motes.interact import collisions
from motes.interact.collisions import slabs


def heap(count: int, seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities of grains, 0.1 m wide, that lie loosely and overlap a little."""
    rng = np.random.default_rng(seed)
    edge = round(count ** (1 / 3))
    lattice = np.stack(np.meshgrid(*[np.arange(edge)] * 3), -1).reshape(-1, 3)
    return lattice * 0.099 + rng.normal(size=lattice.shape) * 0.004, rng.normal(size=lattice.shape)


def grains(x: np.ndarray, v: np.ndarray, periodic: bool = False) -> motes.Simulation:
    """A simulation of such grains, on a floor or in a box that repeats."""
    size = 0.099 * np.ceil(np.ptp(x, axis=0) / 0.099)
    scene = motes.Scene(
        systems=[motes.System("grains", size=0.1)],
        interact=[motes.interact.HardSpheres(restitution=0.5, friction=0.3)],
        force=[] if periodic else [motes.force.Gravity()],
        solid=[] if periodic else [motes.solid.Plane(position=(0, 0, float(x[:, 2].min()) - 0.01))],
        periodic=motes.Periodic(size=tuple(size)) if periodic else motes.Periodic(),
        step=0.004, integrator="semi_implicit_euler", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("grains", x, v)
    return sim


@pytest.mark.parametrize("periodic", [False, True])
def test_grains_depend_neither_on_threads_nor_on_how_tasks_are_shared(
    monkeypatch: pytest.MonkeyPatch, periodic: bool
) -> None:
    """Slabs of one colour share no sphere: all orders of them give the same bits."""
    x, v = heap(1_500)
    digests = set()
    before = motes.threads()
    try:
        for threads, alone in ((1, 10**9), (1, 0), (2, 0), (3, 0)):
            motes.threads(threads)
            monkeypatch.setattr(collisions, "ALONE", alone)
            sim = grains(x, v, periodic)
            sim.run(steps=6)
            digests.add(sim.digest())
    finally:
        motes.threads(before)
    assert len(digests) == 1
    assert np.abs(sim["grains"].velocity - v).max() > 0.5


@pytest.mark.parametrize("reach", [0.1, 0.4])
@pytest.mark.parametrize("box", [(0, 0, 0), (19.0, 0, 0), (23.0, 0, 0), (2.0, 11.3, 0)])
def test_nobody_is_near_two_slabs_that_are_not_neighbours(
    box: tuple[float, float, float], reach: float
) -> None:
    """All within a reach of a sphere are in its slab or in one of two others, and of a ring of
    slabs there is an even number; wherever spheres are that have left the box."""
    rng = np.random.default_rng(1)
    size = np.array(box, float)
    x = rng.random((5_000, 3)) * np.where(size > 0, size, [6.0, 11.0, 3.0])
    x += size * rng.integers(-1, 2, x.shape)
    slab, many = slabs(np.ascontiguousarray(x.T), reach, size)
    assert many > 8
    assert set(slab) == set(range(many))
    i, j = motes.neighbours.within(x, reach, box=np.where(size > 0, size, np.inf))
    for here in range(many):
        others = set(slab[j[slab[i] == here]])
        ring = {(here + k) % many if size.any() else here + k for k in (-1, 0, 1)}
        assert others <= ring
    met = np.unique(np.stack([i, slab[j]], axis=1), axis=0)
    beside = met[met[:, 1] != slab[met[:, 0]]]
    assert np.unique(beside[:, 0], return_counts=True)[1].max() == 1
    assert not size.any() or many % 2 == 0


@pytest.mark.parametrize("layers", [0.4, 1.1, 1.9, 2.2, 3.1, 4.3, 5.2])
@pytest.mark.parametrize("alone", [0, 10**9])
def test_narrow_boxes_that_repeat_hold_their_spheres_apart(
    monkeypatch: pytest.MonkeyPatch, layers: float, alone: int
) -> None:
    """As few layers as there may be across the box: none overlap, momentum and energy stay."""
    monkeypatch.setattr(collisions, "ALONE", alone)
    size = 0.1
    turn = [0, 1, 2] if alone else [2, 0, 1]  # Which axis is the narrow one.
    box = np.array([layers * 2 * size, 0.5, 0.0])[turn]
    rng = np.random.default_rng(3)
    x = rng.random((60, 3)) * np.where(box > 0, box, 3.0)
    v = rng.normal(size=x.shape)
    scene = motes.Scene(
        systems=[motes.System("grains", size=size), motes.System("small", size=0.7 * size)],
        interact=[motes.interact.HardSpheres(restitution=1.0, friction=0.0, rest_speed=0.0,
                                             rounds=300)],
        periodic=motes.Periodic(size=tuple(box)), step=1e-3, integrator="semi_implicit_euler",
        precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("small", x[:30], v[:30])
    sim.place("grains", x[30:], v[30:])
    before = sim.measure()
    sim.run(steps=30)
    after = sim.measure()
    assert after.momentum == pytest.approx(before.momentum, abs=1e-13)
    assert after.kinetic == pytest.approx(before.kinetic, rel=1e-13)
    at = np.concatenate([sim["small"].position, sim["grains"].position])
    away = at[:, None] - at
    period = np.where(box > 0, box, 1e9)
    away -= period * np.round(away / period)
    length = np.sqrt((away**2).sum(axis=2))
    half = np.repeat([0.35 * size, 0.5 * size], 30)
    assert (length / (half[:, None] + half) + np.eye(60)).min() > 1 - 2e-6
    assert np.abs(sim["grains"].velocity - v[30:]).max() > 0.5


def test_spheres_at_one_place_part_and_points_never_meet() -> None:
    for size, count in ((0.1, 3), (0.0, 2)):
        scene = motes.Scene(
            systems=[motes.System("grains", size=size)], interact=[motes.interact.HardSpheres()],
            step=1e-3, integrator="semi_implicit_euler", precision="double",
        )  # fmt: skip
        sim = motes.Simulation(scene)
        sim.place("grains", np.zeros((count, 3)))
        sim.run(steps=3)
        x = sim["grains"].position
        assert (np.diff(np.sort(x[:, 0])) >= size * (1 - 1e-6)).all()
        assert np.abs(x.mean(axis=0)).max() < 1e-15


def test_a_sphere_that_touches_a_solid_bounces_and_rubs() -> None:
    """v_n becomes -e v_n, sliding loses mu (1 + e) v_n; what is slower than rest_speed stays."""
    law = motes.interact.HardSpheres(restitution=0.6, friction=0.2, rest_speed=0.1, rounds=1)
    scene = motes.Scene(
        systems=[motes.System("grains", size=0.1)], interact=[law], solid=[motes.solid.Plane()],
        step=1e-7, integrator="semi_implicit_euler", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    x = np.array([[0, 0, 5e-5], [1, 0, 5e-5], [2, 0, 2e-4], [3, 0, 5e-5]])
    v = np.array([[0.8, 0, -0.5], [0.8, 0, -0.09], [0.8, 0, -0.5], [0.05, 0, -0.5]])
    sim.place("grains", x, v)
    sim.run(steps=1)
    after = [[0.8 - 0.2 * 0.8, 0, 0.3], [0.8 - 0.2 * 0.09, 0, 0], [0.8, 0, -0.5], [0, 0, 0.3]]
    assert sim["grains"].velocity == pytest.approx(np.array(after), abs=1e-12)


def test_slow_spheres_stop_and_friction_takes_no_more_than_the_sliding() -> None:
    """Below the speed of rest nothing bounces; rough spheres leave each other without sliding."""
    for speed, after in ((0.09, 0.0), (0.11, 0.5 * 0.11)):
        law = motes.interact.HardSpheres(restitution=0.5, friction=50.0, rest_speed=0.1, rounds=1)
        scene = motes.Scene(
            systems=[motes.System("grains", size=0.1)], interact=[law], step=1e-4,
            integrator="semi_implicit_euler", precision="double",
        )  # fmt: skip
        sim = motes.Simulation(scene)
        sim.place("grains", [[0.0, 0, 0], [0.0999, 0, 0]], [[speed, 0, 0.07], [0, 0, 0]])
        sim.run(steps=1)
        u = np.diff(sim["grains"].velocity, axis=0)[0]
        assert u == pytest.approx([after, 0, 0], abs=2e-5)  # The line of centres turns a little.


def test_spheres_that_overlap_move_apart_about_their_centre_of_mass() -> None:
    """The light one by what the heavy one weighs, until they touch; in one round, on all axes."""
    way, overlap = np.array([2.0, -1.0, 2.0]) / 3, 0.02
    scene = motes.Scene(
        systems=[motes.System("a", size=0.1), motes.System("b", size=0.14, mass=3.0)],
        interact=[motes.interact.HardSpheres(rounds=1)], step=1e-3,
        integrator="semi_implicit_euler", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("a", [[0.0, 0, 0]])
    sim.place("b", [(0.12 - overlap) * way])
    sim.run(steps=1)
    assert sim["a"].position[0] == pytest.approx(-0.75 * overlap * way, abs=1e-14)
    assert sim["b"].position[0] == pytest.approx((0.12 - 0.75 * overlap) * way, abs=1e-14)
    assert not sim["a"].velocity.any()


def test_order_of_rows_changes_nothing_of_grains() -> None:
    """Collisions are in the order of places and ids: with rows moved, the same to the last bit."""
    x, v = heap(700)
    ends = []
    for moved in (False, True):
        sim = grains(x, v)
        if moved:
            rows = sim._state.systems["grains"]
            rows.reorder(np.random.default_rng(2).permutation(rows.count).astype(np.int32))
        sim.run(steps=5)
        view = sim["grains"]
        ends.append(np.hstack([view.position, view.velocity])[np.argsort(view.id)])
    np.testing.assert_array_equal(ends[0], ends[1])


def test_a_collision_of_unequal_spheres_is_that_of_the_textbook() -> None:
    """Oblique, with friction: v' = v + J/m with J along the line of centres and against sliding.

    J_n = (1 + e) u_n / (1/m1 + 1/m2), J_t = min(mu J_n, u_t / (1/m1 + 1/m2)), with u the approach.
    """
    e, mu, heavy = 0.5, 0.2, 3.0
    scene = motes.Scene(
        systems=[motes.System("a", size=1.0), motes.System("b", size=1.0, mass=heavy)],
        interact=[motes.interact.HardSpheres(restitution=e, friction=mu, rounds=1)],
        step=1e-3, integrator="semi_implicit_euler", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    u, w = np.array([1.0, 0.4, 0.0]), np.array([-0.5, 0.0, 0.3])
    sim.place("a", [[-0.4999, 0, 0]], u)
    sim.place("b", [[0.4999, 0, 0]], w)
    sim.run(steps=1)
    share = 1 / (1 + 1 / heavy)
    normal = (1 + e) * 1.5 * share
    slide = (u - w) * [0, 1, 1]
    speed = np.linalg.norm(slide)
    impulse = np.array([-normal, 0, 0]) - min(mu * normal, speed * share) * slide / speed
    # The line of centres turns by 1e-3 of the slide within the step.
    assert sim["a"].velocity[0] == pytest.approx(u + impulse, abs=2e-3)
    total = sim["a"].velocity[0] + heavy * sim["b"].velocity[0]
    assert total == pytest.approx(u + heavy * w, abs=1e-14)
