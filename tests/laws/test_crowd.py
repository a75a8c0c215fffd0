"""Laws of crowds: nobody overlaps, lanes form, doors limit the flow, density slows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.plain import crowd

import motes
from motes.interact.crowd.avoid import Rules, Walls, avoid
from motes.interact.crowd.density import walking
from motes.interact.crowd.half_plane import contact, reciprocal
from motes.neighbours import nearest


def no_walls(n: int) -> Walls:
    return Walls(np.zeros((n, 0, 3)), np.zeros(n, np.int64))


def rules(**changed: Any) -> Rules:
    known = {"reach": 3.0, "margin": 0.1, "horizon": 2.0, "step": 0.1, "top_speed": 1.5}
    return Rules(**{**known, "crowded": False, **changed})


def closest(p: np.ndarray, v: np.ndarray, horizon: float) -> float:
    """Least of |p - v t| for t from 0 to the horizon."""
    t = np.clip(p @ v / max(v @ v, 1e-30), 0, horizon)
    return float(np.linalg.norm(p - v * t))


@pytest.mark.parametrize("case", range(40))
def test_the_least_change_of_velocity_just_touches(case: int) -> None:
    """Both halves done, the closest approach within the horizon is the sum of the radii; any
    smaller change would collide, if the velocities collide at all."""
    rng = np.random.default_rng(case)
    radius, horizon = 0.5, 2.0
    angle = rng.uniform(0, 2 * np.pi)
    p = rng.uniform(0.6, 4.0) * np.array([np.cos(angle), np.sin(angle)])
    v = rng.uniform(-2, 2, 2)
    nx, ny, c = reciprocal(*p, *v, 0.0, 0.0, radius, horizon, 0.1)
    n, change = np.array([nx, ny]), 2 * c
    assert np.hypot(nx, ny) == pytest.approx(1, rel=1e-12)
    assert closest(p, v + change * n, horizon) == pytest.approx(radius, rel=1e-9)
    assert (change > 0) == (closest(p, v, horizon) < radius)
    for other in np.linspace(0, 2 * np.pi, 60):
        way = np.array([np.cos(other), np.sin(other)])
        inside = closest(p, v + 0.999 * abs(change) * way, horizon) < radius
        assert inside == (change > 0)


def test_halves_of_both_are_opposite() -> None:
    """b's half-plane has the opposite normal and the same change."""
    p, va, vb = np.array([2.0, 0.3]), np.array([1.0, 0.1]), np.array([-0.8, 0.2])
    a = reciprocal(*p, *(va - vb), *va, 0.5, 2.0, 0.1)
    b = reciprocal(*-p, *(vb - va), *vb, 0.5, 2.0, 0.1)
    assert a[:2] == pytest.approx([-b[0], -b[1]], rel=1e-12)
    assert a[2] - np.dot(a[:2], va) == pytest.approx(b[2] - np.dot(b[:2], vb), rel=1e-12)


def test_half_of_the_gap() -> None:
    """Both use up half of the gap in a step: they touch, exactly."""
    nx, ny, c = contact(1.0, 0.0, 0.6, 0.1)
    assert (nx, ny, c) == pytest.approx((-1.0, 0.0, -2.0))
    assert 1.0 - 2 * -c * 0.1 == pytest.approx(0.6)
    assert contact(0.5, 0.0, 0.6, 0.1)[2] == 0


@pytest.mark.parametrize("seed", range(3))
def test_the_crowd_does_what_the_definition_says(seed: int) -> None:
    """The kernels against all pairs and all candidates for the best, written down plainly."""
    rng = np.random.default_rng(seed)
    side = np.arange(4) * 1.6
    x = np.stack(np.meshgrid(side, side)).reshape(2, -1) + rng.uniform(-0.5, 0.5, (2, 16))
    v, wanted = rng.uniform(-1, 1, (2, 2, 16))
    size, law = rng.uniform(0.15, 0.25, 16), rules(reach=4.0, margin=0.08, horizon=1.5)
    found = avoid(x, v, wanted, size, no_walls(16), law, 15)
    compared = 0
    for i in range(16):
        others = [j for j in range(16) if j != i and np.hypot(*(x[:, j] - x[:, i])) <= 4.0]
        planes = []
        for j in others:
            p = x[:, j] - x[:, i]
            n = -p / np.hypot(*p)
            gap = np.hypot(*p) - size[i] - size[j]
            planes.append((n, min(-0.5 * gap / law.step, 0.0)))  # At most half of the gap.
            both = size[i] + size[j] + law.margin
            planes.append(crowd.half_plane(p, v[:, i], v[:, j], both, law.horizon))
        expected = crowd.best(planes, wanted[:, i], law.top_speed)
        if expected is not None:
            compared += 1
            assert found[:, i] == pytest.approx(expected, abs=1e-6)
    assert compared >= 12


def test_a_thousand_on_a_circle_swap_places() -> None:
    """1 000 people go to the opposite point of their circle; all arrive, none ever overlap."""
    n, radius, ring, h = 1000, 0.2, 100.0, 0.25
    angle = 2 * np.pi * np.arange(n) / n
    x = ring * np.array([np.cos(angle), np.sin(angle)])
    goal, v = -x, np.zeros((2, n))
    rng = np.random.default_rng(0)
    law, size = rules(step=h, margin=0.15), np.full(n, radius)
    near = np.inf
    for _ in range(1800):
        way = goal - x
        far = np.maximum(np.hypot(*way), 1e-9)
        if (far < radius).all():
            break
        wanted = way / far * np.minimum(1.4, far / h) + rng.normal(0, 0.3, x.shape) * np.minimum(
            1, far
        )
        v = avoid(x, v, wanted, size, no_walls(n), law, 10)
        x = x + h * v
        near = min(near, nearest(x.T, 1)[1].min())
    assert (np.hypot(*(goal - x)) < radius).all()
    assert near >= 2 * radius * (1 - 1e-9)


def test_order_and_threads_change_nothing() -> None:
    """Permuted people get permuted velocities, for any number of threads, to the last bit."""
    rng = np.random.default_rng(2)
    n = 3000
    x, v = rng.uniform(0, 40, (2, n)).astype(np.float32), rng.normal(size=(2, n))
    wanted, size = rng.normal(size=(2, n)), rng.uniform(0.2, 0.3, n)
    law = rules(crowded=True)
    first = avoid(x, v, wanted, size, no_walls(n), law, 10)
    order = rng.permutation(n)
    again = avoid(x[:, order], v[:, order], wanted[:, order], size[order], no_walls(n), law, 10)
    assert (again == first[:, order]).all()
    threads = motes.threads()
    try:
        motes.threads(3 if threads != 3 else 2)
        assert (avoid(x, v, wanted, size, no_walls(n), law, 10) == first).all()
    finally:
        motes.threads(threads)


def test_the_fundamental_diagram() -> None:
    """Weidmann's v(density); and the density of a lattice is what it is."""
    assert 1.34 * walking(1.0) == pytest.approx(1.34 * (1 - np.exp(-1.913 * (1 - 1 / 5.4))))
    assert walking(1e-9) == walking(0.0) == 1
    assert walking(5.4) == 0.05
    for density in (0.5, 1.0, 2.0, 3.0):
        gap = density**-0.5
        side = np.arange(-20, 21) * gap
        x = np.stack(np.meshgrid(side, side)).reshape(2, -1)
        n = x.shape[1]
        middle = np.flatnonzero(np.hypot(*x) < 1e-9)[0]
        wanted = np.zeros((2, n))
        wanted[0] = 1.34
        law = rules(top_speed=1.34, crowded=True)
        speed = avoid(x, wanted, wanted, np.full(n, 0.01), no_walls(n), law, 4)[0, middle]
        assert speed == pytest.approx(1.34 * walking(density), rel=0.01)


def walkers(
    name: str, place: Any, size: Any, goal: Any, along: Any, will: float = 0.8, **birth: Any
) -> motes.System:
    forces = [
        motes.force.Goal(place=goal, along=along, speed=1.34),
        motes.force.Wander(strength=will, time=0.5, along=(1, 1, 0)),
    ]
    emitter = motes.emit.Box(position=place, size=size, **birth)
    gone = motes.retire.LeavesBox(low=(-20, -20, -1), high=(20, 20, 1))
    return motes.System(name, emit=[emitter], force=forces, size=0.5, retire=[gone])


def scene(systems: list[motes.System], solid: list[Any], **crowd: Any) -> motes.Scene:
    return motes.Scene(
        systems=systems, solid=solid, interact=[motes.interact.Crowd(**crowd)],
        integrator="semi_implicit_euler", step=0.1, precision="double", seed=5,
    )  # fmt: skip


def corridor_order(sim: motes.Simulation) -> float:
    """Mean over people of ((same - opposite) / (same + opposite))^2 among those abreast.

    Abreast are those within 0.4 m of one's line; Rex and Loewen, Physical Review E 75 (2007)
    051402, equation 2.
    """
    x = np.concatenate([sim["east"].position, sim["west"].position])
    sign = np.repeat([1, -1], [len(sim["east"]), len(sim["west"])])
    middle = abs(x[:, 0]) < 8
    y, sign = x[middle, 1], sign[middle]
    abreast = abs(y[:, None] - y) < 0.4
    return float(np.mean(((abreast @ sign) / abreast.sum(axis=1)) ** 2))


def test_two_streams_form_lanes() -> None:
    """Streams against each other in a corridor sort themselves: the lane order rises to about 1."""
    east = walkers("east", (-17, 0, 0), (3, 5, 0), (99, 0, 0), (1, 0, 0), 0.3, rate=2.0)
    west = walkers("west", (17, 0, 0), (3, 5, 0), (-99, 0, 0), (1, 0, 0), 0.3, rate=2.0)
    walls = [
        motes.solid.Box(name=f"wall{s}", position=(0, 3.5 * s, 1), size=(50, 1, 2), collides=False)
        for s in (-1, 1)
    ]
    sim = motes.Simulation(scene([east, west], walls))
    orders = []
    for _ in range(16):
        sim.run(steps=50)
        orders.append(corridor_order(sim) if sim.time > 12 else 0.0)
    assert abs(np.concatenate([sim["east"].position, sim["west"].position])[:, 1]).max() < 2.76
    assert np.mean(orders[-6:]) > np.mean(orders[2:4]) + 0.3
    assert np.mean(orders[-6:]) > 0.7


def outflow(width: float) -> float:
    """People a second through a door of a width [m], between the 30th and the 120th."""
    people = walkers("people", (-4, 0, 0), (7, 14, 0), (6, 0, 0), (1, 1, 0), burst=[{"count": 160}])
    people = people.model_copy(update={
        "retire": (motes.retire.LeavesBox(low=(-20, -20, -1), high=(3, 20, 1)),)
    })  # fmt: skip
    side = 10 - width / 2
    walls = [
        motes.solid.Box(
            name=f"wall{s}", position=(0, s * (width / 2 + side / 2), 1), size=(0.3, side, 2),
            collides=False,
        )
        for s in (-1, 1)
    ]  # fmt: skip
    sim = motes.Simulation(scene([people], walls, horizon=1.0, reach=2.0, margin=0.02))
    times = []
    for _ in range(3000):
        sim.run(steps=1)
        gone = 160 - len(sim["people"])
        times += [sim.time] * (gone - len(times))
        if gone >= 120:
            return 90 / (times[119] - times[29])
    return 0.0


def test_the_flow_through_a_door_falls_with_its_width() -> None:
    """Wider doors let more through, by more than the width: 0.6 to 1.1 a second and metre."""
    widths = (1.2, 1.8, 2.6)
    flows = [outflow(width) for width in widths]
    assert 0.5 < flows[0] < flows[1] - 0.5 < flows[2] - 1.0
    assert flows[2] < 5


def test_a_crowd_needs_kicks_and_drifts() -> None:
    """A Runge-Kutta method has no instant at which a velocity could be restricted."""
    people = walkers("people", (0, 0, 0), (5, 5, 0), (9, 0, 0), (1, 1, 0), burst=[{"count": 2}])
    with pytest.raises(motes.SceneError, match="semi_implicit_euler"):
        motes.Simulation(motes.Scene(systems=[people], interact=[motes.interact.Crowd()]))


def test_parties_stay_together() -> None:
    """Threes that walk at paces of their own, through others, stay within two steps; without the
    law they lose each other. A party is three births after one another, wherever rows have gone."""

    def spread(*laws: Any) -> tuple[float, float]:
        emitter = motes.emit.Parties(burst=[{"count": 60}], size=(6, 12, 0), position=(-9, 0, 0))
        forces = [
            motes.force.Goal(place=(99, 0, 0), along=(1, 0, 0), speed={"mean": 1.2, "spread": 0.4}),
            motes.force.Wander(strength=0.4, along=(1, 1, 0)),
        ]
        people = motes.System("people", emit=[emitter], force=forces, size=0.4)
        sim = motes.Simulation(motes.Scene(
            systems=[people], interact=[motes.interact.Crowd(), *laws], step=0.1, seed=3,
            integrator="semi_implicit_euler", precision="double",
        ))  # fmt: skip
        sim.run(steps=1)
        rows = sim._state.systems["people"]
        stream, number = sim._steppers["people"].numbers(rows, rows.count, sim.time)
        assert (stream == stream[0]).all()
        assert (np.sort(number) == np.arange(1, 61)).all()
        ids, party = sim["people"].id.copy(), (number - 1) // 3

        def widest() -> float:
            which = dict(zip(ids, party, strict=True))
            now = np.array([which[i] for i in sim["people"].id])
            x = sim["people"].position
            return float(np.median([np.ptp(x[now == k], axis=0).max() for k in range(20)]))

        first = widest()
        sim.run(until=16.0)
        return first, widest()

    first, apart = spread()
    same, together = spread(motes.interact.Party(members=3, strength=2.0, room=0.8))
    assert first < 1.5
    assert same < 1.5
    assert apart > 5.0
    assert together < 2.2


def test_the_pull_of_a_party() -> None:
    """Two, 4 m apart, with room 0.8 m: the whole strength; 2.4 m apart: half of it."""
    for gap, share in ((4.0, 1.0), (2.4, 0.5), (1.6, 0.0)):
        emitter = motes.emit.Parties(
            burst=[{"count": 2}], members=2, size=(0, 0, 0), spacing=(gap, 0, 0), scatter=0.0
        )
        pair = motes.System("pair", emit=[emitter], force=[motes.force.Cruise(speed=0.0)])
        sim = motes.Simulation(motes.Scene(
            systems=[pair], interact=[motes.interact.Party(members=2, strength=3.0, room=0.8)],
            step=0.01, integrator="semi_implicit_euler", precision="double",
        ))  # fmt: skip
        sim.run(steps=1)
        x, v = sim["pair"].position[:, 0], sim["pair"].velocity[:, 0]
        assert v * -np.sign(x) == pytest.approx(0.01 * 3.0 * share, abs=1e-9)
