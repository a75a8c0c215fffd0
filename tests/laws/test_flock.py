"""Laws of flocks: what cells give equals brute force, and nothing hangs on names or axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.laws.boids import RULES, born, flock
from tests.plain.flock import boids

import motes
from motes import catalog
from motes.catalog import component
from motes.kernel import kernel
from motes.scene import from_document


@pytest.mark.parametrize("box", [None, 6.5, 10.2])
def test_a_step_is_that_of_all_pairs(box: float | None) -> None:
    """v' = v + h a with a from the double loop over all pairs, also across periodic borders: by
    lists where the period holds less than five reaches, else by cells."""
    periodic = {} if box is None else {
        "periodic": motes.Periodic(low=(-box / 2,) * 3, size=(box,) * 3)
    }  # fmt: skip
    sim = flock(400 if box == 10.2 else 300, size=10.1 if box == 10.2 else 6.0, **periodic)
    assert (sim._groups[0].nearby.swarm is None) == (box == 6.5)
    x, v = born(sim)
    sim.run(steps=1)
    view, order = sim["boids"], np.argsort(sim["boids"].id)
    expected = v + 0.02 * boids(x, v, RULES, box)
    assert view.velocity[order] == pytest.approx(expected, rel=1e-9, abs=1e-11)


def test_single_precision_is_that_of_all_pairs_but_for_rounding() -> None:
    """Roots by an estimate and one step of Newton's method, sums of some twenty: 1e-6 of those in
    double precision, also for two in the same place."""
    sim = flock(300, precision="single")
    x, v = born(sim)
    sim.run(steps=1)
    rows = sim._state.systems["boids"]
    rows.position[:, 1] = rows.position[:, 0]
    x, v = rows.position[:, :300].T.astype(float), rows.velocity[:, :300].T.astype(float)
    pushes = {"boids": np.zeros((3, 300), np.float32)}
    bodies = sim._groups[0]._bodies(sim._state.systems, {"boids": 300}, sim.time)
    sim._groups[0].nearby.swarm.push(bodies, pushes, set())
    expected = boids(x, v, RULES, None)
    assert np.abs(pushes["boids"].T - expected).max() < 2e-6 * np.abs(expected).max()


def test_a_topological_flock_minds_the_seven_nearest() -> None:
    """With nearest = 7 the sums run over seven, wherever they are."""
    cohesion = motes.interact.Cohesion(radius=3.0, strength=2.0, angle=180.0, nearest=7)
    sim = flock()
    sim = motes.Simulation(sim.scene.model_copy(update={"interact": (cohesion,)}))
    x, v = born(sim)
    sim.run(steps=1)
    order = np.argsort(sim["boids"].id)
    r = x[:, None] - x
    d = np.sqrt((r**2).sum(axis=2))
    np.fill_diagonal(d, np.inf)
    near = np.argsort(d, axis=1)[:, :7]
    w = np.take_along_axis(np.maximum(1 - d / 3.0, 0), near, axis=1)
    mean = (w[:, :, None] * np.take_along_axis(r, near[:, :, None], axis=1)).sum(axis=1)
    a = -2.0 * mean / (3.0 * (w.sum(axis=1) + 0.05))[:, None]
    assert sim["boids"].velocity[order] == pytest.approx(v + 0.02 * a, rel=1e-9, abs=1e-11)


def moved(sim: motes.Simulation, x: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A flock that starts at x and v, after twenty steps, in the same order."""
    sim.run(steps=1)
    rows = sim._state.systems["boids"]
    rows.position[:, : rows.count], rows.velocity[:, : rows.count] = x.T, v.T
    rows.ids[: rows.count] = np.arange(rows.count)
    sim.run(steps=20)
    order = np.argsort(sim["boids"].id)
    return sim["boids"].position[order], sim["boids"].velocity[order]


def test_permutation_translation_and_rotation() -> None:
    """The law knows no names, places or directions: the motion is the same but for rounding."""
    rng = np.random.default_rng(3)
    x, v = rng.uniform(-3, 3, (300, 3)), rng.normal(size=(300, 3))
    a, va = moved(flock(), x, v)
    order = rng.permutation(300)
    b, vb = moved(flock(), x[order], v[order])
    assert b == pytest.approx(a[order], abs=1e-9)
    assert vb == pytest.approx(va[order], abs=1e-9)
    shift = np.array([100.0, -50.0, 7.0])
    c, _ = moved(flock(), x + shift, v)
    assert c - shift == pytest.approx(a, abs=1e-9)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    d, vd = moved(flock(), x @ turn.T, v @ turn.T)
    assert d == pytest.approx(a @ turn.T, abs=1e-9)
    assert vd == pytest.approx(va @ turn.T, abs=1e-9)


def test_threads_change_nothing() -> None:
    """The same bits for any number of threads."""
    threads, digests = motes.threads(), []
    try:
        for count in (1, 3):
            motes.threads(count)
            sim = flock(3000, precision="single")
            sim.run(steps=5)
            digests.append(sim.digest())
    finally:
        motes.threads(threads)
    assert digests[0] == digests[1]


def order_of(noise: float) -> float:
    """|mean of v / |v|| of a flock with noise, after it had time to settle."""
    rules = [motes.interact.Alignment(radius=1.0, rate=4.0, angle=180.0)]
    force = [
        motes.force.Cruise(speed=1.0, response=0.1),
        motes.force.Wander(strength=noise, time=0.1),
    ]
    emitter = motes.emit.Box(
        burst=[{"count": 400}], size=(5, 5, 5), velocity={"low": [-1] * 3, "high": [1] * 3}
    )
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("boids", emit=[emitter], force=force)], interact=rules, seed=2,
        periodic=motes.Periodic(low=(-2.5,) * 3, size=(5,) * 3), step=0.04,
        integrator="semi_implicit_euler",
    ))  # fmt: skip
    sim.run(steps=500)
    orders = []
    for _ in range(10):
        sim.run(steps=10)
        v = sim["boids"].velocity
        orders.append(np.linalg.norm((v / np.linalg.norm(v, axis=1, keepdims=True)).mean(axis=0)))
    return float(np.mean(orders))


def test_the_order_falls_with_noise() -> None:
    """Order at weak noise, none at strong: Vicsek et al., Phys. Rev. Letters 75 (1995) 1226."""
    weak, middle, strong = (order_of(noise) for noise in (0.5, 10.0, 60.0))
    assert weak > 0.98
    assert weak > middle > strong
    assert strong < 0.2


@component(kind="interact", name="staircase")
class Staircase:
    """A law that no lanes can walk: a loop whose length differs from pair to pair."""

    def reach(p: Any) -> float:
        return 1.5

    @kernel
    def near(p, a, b, r):
        steps, left = 0.0, r.length
        while left > 0.25:
            left -= 0.25
            steps += 1.0
        return (steps * r.x,)

    @kernel
    def acceleration(p, a, s):
        return s[0], 0.0, 0.0


catalog._forget("interact", "staircase")  # Menus that other tests read do not name it.


def test_a_law_with_a_loop_works_too() -> None:
    """What works on no lanes goes one target after another, to the same sums."""
    sim = flock(200)
    sim = motes.Simulation(sim.scene.model_copy(update={"interact": (Staircase(),)}))
    x, v = born(sim)
    sim.run(steps=1)
    r = x[:, None] - x
    d = np.sqrt((r**2).sum(axis=2))
    steps = np.where(d <= 1.5, np.ceil(d / 0.25 - 1), 0)
    kick = 0.02 * (steps * r[:, :, 0]).sum(axis=1)
    order = np.argsort(sim["boids"].id)
    assert sim["boids"].velocity[order, 0] - v[:, 0] == pytest.approx(kick, abs=1e-9)


def pairs_of(x: np.ndarray, box: float | None) -> tuple[np.ndarray, np.ndarray]:
    """r = x_i - x_j (n, n, 3) to the nearest image, and its length."""
    r = x[:, None] - x
    if box is not None:
        r -= box * np.round(r / box)
    return r, np.sqrt((r**2).sum(axis=2))


@pytest.mark.parametrize("case", ["even", "clumps", "far apart", "periodic"])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_cells_find_the_neighbours_that_brute_force_finds(case: str, precision: str) -> None:
    """Who is felt, one by one: a law that adds up 2^k for each of 20 marked points within reach;
    where points are dense, alone, or beyond a border."""
    rng = np.random.default_rng(7)
    n, radius, box = 700, 1.0, None
    x = rng.uniform(-3, 3, (n, 3))
    if case == "clumps":
        x[: n // 2] = rng.normal(0, 0.4, (n // 2, 3)) + 2
    elif case == "far apart":
        x[::7] *= 1000
    elif case == "periodic":
        box = 6.0
    settings: dict[str, Any] = {"precision": precision, "integrator": "semi_implicit_euler"}
    if box:
        settings["periodic"] = motes.Periodic(low=(-3,) * 3, size=(box,) * 3)
    emitter = motes.emit.Point(burst=[{"count": n}])
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("points", emit=[emitter])], interact=[Marks(radius=radius)],
        step=1.0, **settings,
    ))  # fmt: skip
    sim.run(steps=1)
    rows = sim._state.systems["points"]
    rows.position[:, :n], rows.velocity[:, :n] = x.T, 0.0
    _, d = pairs_of(rows.position[:, :n].T.astype(float), box)
    sure = np.flatnonzero((abs(d - radius) > 1e-5).all(axis=0))  # Rounding decides no pair of them.
    mark = np.zeros(n)
    mark[rng.permutation(sure)[:20]] = 2.0 ** np.arange(20)
    rows.velocity[0, :n] = mark
    swarm = sim._groups[0].nearby.swarm
    assert swarm is not None
    pushes = {"points": np.zeros((3, n), rows.position.dtype)}
    bodies = sim._groups[0]._bodies(sim._state.systems, {"points": n}, sim.time)
    swarm.push(bodies, pushes, set())
    near = (d < radius) & ~np.eye(n, dtype=bool)
    assert (pushes["points"][0] == near @ mark).all()
    assert near.sum() > 5 * n


@component(kind="interact", name="marks")
class Marks:
    """The sum of the marks, kept as velocities, of all within reach."""

    radius: motes.catalog.Number = motes.catalog.quantity(1.0, "m", above=0)

    def reach(p: Any) -> float:
        return float(p.radius)

    @kernel
    def near(p, a, b, r):
        return (b.vx,)

    @kernel
    def acceleration(p, a, s):
        return s[0], 0.0, 0.0


catalog._forget("interact", "marks")


def test_weights_and_radii_follow_curves() -> None:
    """Two boids 1 m apart: at each step the kick is that of the strength and radius of then."""
    curve = {"over": "time", "keys": [[0, 0], [1, 10]]}
    wide = {"over": "time", "keys": [[0, 1.5], [1, 3.5]]}
    emitters = [
        motes.emit.Point(name=f"p{k}", burst=[{"count": 1}], position=(k, 0, 0)) for k in range(2)
    ]
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("pair", emit=emitters)],
        interact=[motes.interact.Separation(strength=curve, radius=wide)],
        precision="double", integrator="semi_implicit_euler", step=0.1,
    ))  # fmt: skip
    sim.run(steps=1)
    for _ in range(8):
        x, v = sim["pair"].position[:, 0].copy(), sim["pair"].velocity[:, 0].copy()
        now = sim.time
        sim.run(steps=1)
        d, strength, radius = np.ptp(x), 10 * now, 1.5 + 2 * now
        kick = 0.1 * strength * (1 - d / radius)
        change = np.ptp(sim["pair"].velocity[:, 0]) - np.ptp(v)
        assert change == pytest.approx(2 * kick, abs=1e-9)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"type": "separation", "radius": 0}, "radius"),
        ({"type": "separation", "strength": -1}, "strength"),
        ({"type": "alignment", "angle": 181}, "angle"),
        ({"type": "cohesion", "nearest": -7}, "nearest"),
        ({"type": "cohesion", "nearest": 1.5}, "nearest"),
        ({"type": "pursue", "radius": "far"}, "radius"),
        ({"type": "evade", "sources": ["hawks"]}, "hawks"),
        ({"type": "capture", "hunters": ["hawks"]}, "hawks"),
        ({"type": "capture"}, "hunters"),
        ({"type": "capture", "radius": -1}, "radius"),
        ({"type": "crowd", "systems": ["nobody"]}, "nobody"),
        ({"type": "crowd", "horizon": 0}, "horizon"),
        ({"type": "party", "members": 0}, "members"),
        ({"type": "party", "systems": ["nobody"]}, "nobody"),
        ({"type": "separations"}, "separation"),
    ],
)
def test_nonsense_gets_one_clear_line(wrong: dict[str, Any], said: str) -> None:
    """A parameter out of range, of a wrong type, or a system that is not there."""
    scene = {
        "integrator": "semi_implicit_euler",
        "interact": [wrong],
        "system": [
            {"name": "hawk", "emit": [{"type": "point", "burst": [{"count": 1}]}]},
            {"name": "birds", "emit": [{"type": "point", "burst": [{"count": 1}]}]},
        ],
    }
    with pytest.raises(motes.SceneError) as told:
        motes.Simulation(from_document(scene)).run(steps=1)
    assert said in str(told.value)
    assert "Traceback" not in str(told.value)
    assert str(told.value).count("\n") == 0
