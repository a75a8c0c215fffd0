"""Laws of flocks: what cells give equals brute force, and nothing hangs on names or axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.plain.flock import boids

import motes
from motes import catalog
from motes.catalog import component
from motes.kernel import kernel

RULES = {
    "separation": {"radius": 0.8, "strength": 3.0},
    "alignment": {"radius": 1.5, "rate": 1.0, "angle": 100.0},
    "cohesion": {"radius": 2.0, "strength": 2.0, "angle": 180.0},
}


def rules() -> list[Any]:
    return [
        motes.interact.Separation(**RULES["separation"]),
        motes.interact.Alignment(**RULES["alignment"]),
        motes.interact.Cohesion(**RULES["cohesion"]),
    ]


def flock(n: int = 300, **settings: Any) -> motes.Simulation:
    """A cloud of boids of about twenty neighbours, without a step taken."""
    emitter = motes.emit.Box(
        burst=[{"count": n}], size=(6, 6, 6), velocity={"low": [-1, -1, -1], "high": [2, 1, 1]}
    )
    known = {"precision": "double", "integrator": "semi_implicit_euler", "step": 0.02, "seed": 4}
    system = motes.System("boids", emit=[emitter], force=settings.pop("force", []))
    return motes.Simulation(
        motes.Scene(systems=[system], interact=rules(), **{**known, **settings})
    )


def born(sim: motes.Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities at birth, of the same flock without laws: x and v at time 0, by id."""
    bare = sim.scene.model_copy(update={"interact": ()})
    other = motes.Simulation(bare)
    other.run(steps=1)
    view, order = other["boids"], np.argsort(other["boids"].id)
    v = view.velocity[order]
    return view.position[order] - bare.step * v, v


@pytest.mark.parametrize("box", [None, 6.5])
def test_a_step_is_that_of_all_pairs(box: float | None) -> None:
    """v' = v + h a with a from the double loop over all pairs, also across periodic borders."""
    periodic = {} if box is None else {
        "periodic": motes.Periodic(low=(-box / 2,) * 3, size=(box,) * 3)
    }  # fmt: skip
    sim = flock(**periodic)
    x, v = born(sim)
    sim.run(steps=1)
    view, order = sim["boids"], np.argsort(sim["boids"].id)
    expected = v + 0.02 * boids(x, v, RULES, box)
    assert view.velocity[order] == pytest.approx(expected, rel=1e-9, abs=1e-11)


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


def hunt(**capture: Any) -> motes.Simulation:
    """A hawk that flies along a row of ten mice."""
    mice = motes.System(
        "mice", emit=[motes.emit.Point(name=f"m{k}", burst=[{"count": 1}], position=(k, 0, 0))
                      for k in range(10)],
        force=[motes.force.Cruise(speed=0.0)],
    )  # fmt: skip
    hawk = motes.System(
        "hawk",
        emit=[motes.emit.Point(burst=[{"count": 1}], position=(-1, 0.2, 0), velocity=(1, 0, 0))],
        force=[motes.force.Cruise(speed=1.0)],
    )
    law = motes.interact.Capture(hunters=["hawk"], radius=0.25, **capture)
    return motes.Simulation(motes.Scene(
        systems=[mice, hawk], interact=[law], step=0.05, integrator="semi_implicit_euler",
        precision="double",
    ))  # fmt: skip


def test_captures_are_deaths_and_are_told() -> None:
    """Each mouse dies once the hawk is within the radius: 0.15 m before it is beside it."""
    sim = hunt()
    sim.run(until=5.5)
    assert len(sim["mice"]) == 5
    assert len(sim["hawk"]) == 1
    told = sim.captures
    assert told["time"] == pytest.approx(np.arange(5) + 0.85, abs=0.0501)
    assert (told["hunter"] == sim["hawk"].id[0]).all()
    assert told["place"][:, 0] == pytest.approx(np.arange(5))
    assert not set(told["prey"]) & set(sim["mice"].id)
    before = len(sim.captures)
    sim.frame(8.0)
    assert len(sim.captures) == before  # A look ahead catches nobody.


def test_the_rate_of_captures() -> None:
    """A hundred and twenty mice near a cat that waits: in 0.3 s one is caught with the chance
    1 - exp(-0.3 rate) a step-free law gives; the cat takes the nearest first, one a step."""
    alone = [
        motes.emit.Point(name=f"{who}{k}", burst=[{"count": 1}], position=(10 * k, 0.1 * far, 0))
        for who, far in (("cat", 0), ("mouse", 1))
        for k in range(120)
    ]
    still = [motes.force.Cruise(speed=0.0)]
    law = motes.interact.Capture(hunters=["cats"], radius=0.25, rate=2.0)
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("cats", emit=alone[:120], force=still),
                 motes.System("mice", emit=alone[120:], force=still)],
        interact=[law], step=0.05, integrator="semi_implicit_euler", seed=1,
    ))  # fmt: skip
    for end in (0.3, 1.0):
        sim.run(until=end)
        share = 1 - np.exp(-2.0 * end)
        assert abs(len(sim.captures) / 120 - share) < 3 * np.sqrt(share * (1 - share) / 120)


def lone(forces: list[Any], solid: Any = (), velocity: Any = (1, 0, 0), **settings: Any) -> Any:
    emitter = motes.emit.Point(burst=[{"count": 1}], velocity=velocity)
    return motes.Simulation(motes.Scene(
        systems=[motes.System("bird", emit=[emitter], force=forces)], solid=list(solid),
        precision="double", **{"step": 0.01, **settings},
    ))  # fmt: skip


def test_solids_are_steered_around_before_they_are_hit() -> None:
    """A bird that flies at a ball, nearly head on, keeps its speed and the margin."""
    ball = motes.solid.Sphere(position=(5, 0.3, 0.1), radius=1.0)
    sim = lone([motes.force.Avoid(margin=0.4, horizon=3.0), motes.force.Cruise(speed=1.0)], [ball])
    gaps = []
    for _ in range(120):
        sim.run(steps=10)
        gaps.append(np.linalg.norm(sim["bird"].position[0] - (5, 0.3, 0.1)) - 1.0)
    assert min(gaps) > 0.39
    assert min(gaps) < 0.8
    assert sim["bird"].position[0, 0] > 6.5
    assert sim.impacts == 0


def test_a_wall_is_not_reached() -> None:
    """Against a wall, without other forces, the speed towards it ends before the margin."""
    wall = motes.solid.Plane(position=(3, 0, 0), rotation=(0, -90, 0))
    sim = lone([motes.force.Avoid(margin=0.5, horizon=2.0)], [wall], velocity=(1.0, 0.3, 0))
    furthest = 0.0
    for _ in range(200):
        sim.run(steps=10)
        furthest = max(furthest, sim["bird"].position[0, 0])
    assert furthest == pytest.approx(2.5, abs=0.1)
    assert sim.impacts == 0


def test_hovering_follows_the_ground() -> None:
    """The gap to a slope becomes the height."""
    slope = motes.solid.Plane(rotation=(0, -20, 0), position=(0, 0, -3))
    sim = lone([motes.force.Hover(height=1.5)], [slope])
    sim.run(until=8.0)
    x, _, z = sim["bird"].position[0]
    angle = np.radians(20)
    assert abs((z + 3) * np.cos(angle) - x * np.sin(angle)) == pytest.approx(1.5, abs=1e-3)


@pytest.mark.parametrize("integrator", ["rk4", "semi_implicit_euler"])
def test_limits_of_speed_turn_and_thrust(integrator: str) -> None:
    """A strong pull to a side turns by no more than `turn`, speed stays between its limits."""
    limits = motes.force.Agility(least_speed=0.8, top_speed=1.2, turn=45.0, thrust=9.0)
    pull = motes.force.Homing(center=(0, 100, 0), radius=1.0, strength=1.0)
    sim = lone([limits, pull], integrator=integrator)
    sim.run(until=1.0)
    v = sim["bird"].velocity[0]
    assert np.degrees(np.arctan2(v[1], v[0])) == pytest.approx(45, abs=1.5)
    sim.run(until=6.0)
    assert np.linalg.norm(sim["bird"].velocity[0]) == pytest.approx(1.2, abs=0.01)
    still = lone([limits, motes.force.Cruise(speed=0.0, response=0.05)], integrator=integrator)
    still.run(until=3.0)
    assert np.linalg.norm(still["bird"].velocity[0]) == pytest.approx(0.8, abs=0.01)


def test_wandering_does_not_depend_on_the_step() -> None:
    """Half the step gives the same walk, to the order of the method."""
    ends = []
    for step in (0.02, 0.01, 0.005):
        sim = lone([motes.force.Wander(strength=2.0, time=0.7)], step=step)
        sim.run(until=4.0)
        ends.append(sim["bird"].position[0])
    assert np.linalg.norm(ends[1] - ends[2]) < 1e-6
    assert np.linalg.norm(ends[0] - ends[1]) < 1e-5


def test_followers_come_up_behind_their_leader() -> None:
    """A place `behind` on the leader's way, at his velocity."""
    leader = motes.System(
        "leader", emit=[motes.emit.Point(burst=[{"count": 1}], velocity=(2, 1, 0))],
        force=[motes.force.Cruise(speed=5**0.5)],
    )  # fmt: skip
    dog = motes.System(
        "dog", emit=[motes.emit.Point(burst=[{"count": 1}], position=(0, 5, 1))],
        force=[motes.force.Wander(strength=0.0)],
    )  # fmt: skip
    law = motes.interact.FollowLeader(systems=["dog"], sources=["leader"], behind=2.0, response=0.5)
    sim = motes.Simulation(motes.Scene(
        systems=[leader, dog], interact=[law], precision="double", integrator="rk4"
    ))  # fmt: skip
    sim.run(until=12.0)
    way = sim["leader"].position[0] - sim["dog"].position[0]
    assert way == pytest.approx(2 * np.array([2, 1, 0]) / 5**0.5, abs=1e-6)


def test_hunters_close_in_and_prey_flees() -> None:
    """Pursuit turns to the prey's future place; evasion leads away from the hunter."""
    hawk = motes.System(
        "hawk", emit=[motes.emit.Point(burst=[{"count": 1}], velocity=(1, 0, 0))],
    )  # fmt: skip
    dove = motes.System(
        "dove",
        emit=[motes.emit.Point(burst=[{"count": 1}], position=(4, 0, 0), velocity=(0, 1, 0))],
    )
    laws = [
        motes.interact.Pursue(systems=["hawk"], sources=["dove"], strength=2.0, foresight=1.0),
        motes.interact.Evade(systems=["dove"], sources=["hawk"], strength=3.0, foresight=0.0,
                             radius=8.0),
    ]  # fmt: skip
    sim = motes.Simulation(motes.Scene(
        systems=[hawk, dove], interact=laws, precision="double", step=0.01,
        integrator="semi_implicit_euler",
    ))  # fmt: skip
    sim.run(steps=1)
    aim = np.array([4, 0, 0]) + (np.array([0, 1, 0]) - np.array([1, 0, 0])) * 1.0
    kick = (sim["hawk"].velocity[0] - (1, 0, 0)) / 0.01
    assert kick == pytest.approx(2.0 * aim / np.linalg.norm(aim), abs=1e-9)
    assert (sim["dove"].velocity[0] - (0, 1, 0)) / 0.01 == pytest.approx([3 * 0.5, 0, 0], abs=1e-9)


def species(n: int, **settings: Any) -> motes.Simulation:
    """Two species that keep apart from all, fly with their own kind, and one flees the other."""
    systems = [
        motes.System(name, emit=[motes.emit.Box(
            burst=[{"count": n}], size=(5, 5, 5), velocity={"low": [-1] * 3, "high": [2, 1, 1]}
        )]) for name in ("doves", "geese")
    ]  # fmt: skip
    laws = [
        motes.interact.Separation(radius=1.0, strength=3.0),
        *(motes.interact.Alignment(name=f"a{name}", systems=[name], radius=1.5, rate=1.0)
          for name in ("doves", "geese")),
        motes.interact.Evade(systems=["doves"], sources=["geese"], radius=1.2, strength=2.0),
    ]  # fmt: skip
    known = {"precision": "double", "integrator": "semi_implicit_euler", "step": 0.02, "seed": 4}
    return motes.Simulation(motes.Scene(systems=systems, interact=laws, **{**known, **settings}))


def test_several_species_feel_each_other() -> None:
    """A law of two sources sums over both; one among a kind does not see the other kind."""
    sim = species(120)
    names = ("doves", "geese")
    start = sim.scene.model_copy(update={"interact": ()})
    other = motes.Simulation(start)
    other.run(steps=1)
    sim.run(steps=1)
    v = np.concatenate([other[n].velocity[np.argsort(other[n].id)] for n in names])
    x = np.concatenate([other[n].position[np.argsort(other[n].id)] for n in names]) - 0.02 * v
    found = np.concatenate([sim[n].velocity[np.argsort(sim[n].id)] for n in names])
    r = x[:, None] - x
    d = np.sqrt((r**2).sum(axis=2)) + 10 * np.eye(240)
    kind = np.repeat([0, 1], 120)
    same = kind[:, None] == kind
    apart = np.where(d < 1.0, (1 - d) / (d + 1e-6), 0)
    a = 3.0 * (apart[:, :, None] * r).sum(axis=1)
    ahead = -np.einsum("ik,ijk->ij", v, r)
    seen = ahead >= np.cos(np.radians(135)) * np.linalg.norm(v, axis=1)[:, None] * d
    w = np.where((d < 1.5) & same & seen, 1 - d / 1.5, 0)
    total = (w[:, :, None] * (v[None] - v[:, None])).sum(axis=1)
    a += total / (w.sum(axis=1) + 0.05)[:, None]
    kick = (found - v) / 0.02
    geese = kind == 1
    assert kick[geese] == pytest.approx(a[geese], abs=1e-9)
    fled = kick[~geese] - a[~geese]
    near = (np.where(geese, d, 10)[~geese] < 0.7).any(axis=1)
    assert np.linalg.norm(fled[near], axis=1).min() > 0.1
    assert fled[(np.where(geese, d, 10)[~geese] > 2.5).all(axis=1)] == pytest.approx(0, abs=1e-9)


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


def test_laws_mix_with_wind_terrain_and_solids() -> None:
    """Flocking, a goal, wind, terrain that is hovered over and a ball that is flown around in one
    scene: each force changes the flight, the ball is not hit, and the sum is that of all."""
    ball = motes.solid.Sphere(name="ball", position=(0, 0, 2), radius=1.0)
    ground = motes.solid.Plane(name="ground", rotation=(0, -5, 0))
    forces = {
        "goal": motes.force.Goal(place=(30, 0, 2), speed=2.0, along=(1, 0, 0)),
        "wind": motes.force.Wind(velocity=(0, 0.5, 0), grip=0.3),
        "hover": motes.force.Hover(height=2.0),
        "avoid": motes.force.Avoid(margin=0.3, horizon=1.5),
        "wander": motes.force.Wander(strength=0.3),
    }
    emitter = motes.emit.Flock(radius=1.0, speed=2.0, direction=(1, 0, 0), position=(-6, 0, 2),
                               burst=[{"count": 40}], bend=0.0)  # fmt: skip

    def fly(left_out: str = "", laws: bool = True) -> np.ndarray:
        some = [force for name, force in forces.items() if name != left_out]
        sim = motes.Simulation(motes.Scene(
            systems=[motes.System("birds", emit=[emitter], force=some)], solid=[ball, ground],
            interact=rules() if laws else [], precision="double", step=0.04,
            integrator="semi_implicit_euler", seed=3,
        ))  # fmt: skip
        sim.run(until=7.0)
        if not left_out and laws:
            assert sim.impacts == 0
        return sim["birds"].position[np.argsort(sim["birds"].id)]

    whole = fly()
    assert (np.linalg.norm(whole - (0, 0, 2), axis=1) > 1.0).all()
    assert whole[:, 0].mean() > 1.0
    for name in forces:
        assert np.abs(fly(name) - whole).max() > 0.02
    assert np.abs(fly(laws=False) - whole).max() > 0.1


def test_a_flock_is_born_on_a_turn() -> None:
    """All fly at right angles to the way to one centre, at the same rate around it if slower
    inside; the ones ahead, at the ball's edge, have turned by the bend."""
    emitter = motes.emit.Flock(radius=2.0, stretch=(0.5, 0.5, 2.0), speed=3.0, bend=60.0,
                               burst=[{"count": 500}])  # fmt: skip
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("birds", emit=[emitter])], precision="double", step=1e-9,
    ))  # fmt: skip
    sim.run(steps=1)
    x, v = sim["birds"].position, sim["birds"].velocity
    center = np.array([4.0 / np.radians(60), 0, 0])
    assert ((x - center) * v)[:, [0, 2]].sum(axis=1) == pytest.approx(0, abs=1e-6)
    assert np.linalg.norm(v, axis=1) == pytest.approx(3, rel=1e-9)
    turned = np.degrees(np.arctan2(v[:, 0], v[:, 2]))
    assert 40 < turned.max() <= 60
    assert abs(turned.mean()) < 3
    assert np.abs(x[:, 1]).max() <= 1.0
