"""Every steering behaviour is its formula, written down once more: the kick of one short step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import motes

STEP = 1e-6
"""Short, so that a method's order does not show: kicks are accelerations to a few 1e-6."""

Array = np.ndarray
Formula = Callable[[Array, Array], Array]


def size_of(v: Array) -> Array:
    return np.linalg.norm(v, axis=-1, keepdims=True)


def kick(scene: motes.Scene, name: str) -> tuple[Array, Array, Array]:
    """Positions, velocities (n, 3) at birth, and accelerations in a scene's first step, by id."""
    bare = [s.model_copy(update={"force": ()}) for s in scene.systems]
    still = motes.Simulation(scene.model_copy(update={"systems": tuple(bare), "interact": ()}))
    sim = motes.Simulation(scene)
    for one in (still, sim):
        one.run(steps=1)
    before, after = (one[name].velocity[np.argsort(one[name].id)] for one in (still, sim))
    x = still[name].position[np.argsort(still[name].id)] - STEP * before
    return x, before, (after - before) / STEP


def birds(n: int = 60, name: str = "birds", force: Any = (), **where: Any) -> motes.System:
    known = {"size": (8, 6, 4), "velocity": {"low": [-3, -2, -2], "high": [4, 3, 2]}}
    emitter = motes.emit.Box(burst=[{"count": n}], **{**known, **where})
    return motes.System(name, emit=[emitter], force=list(force))


def scene(systems: list[motes.System], **settings: Any) -> motes.Scene:
    known = {"precision": "double", "integrator": "euler", "step": STEP, "seed": 6}
    return motes.Scene(systems=systems, **{**known, **settings})


SLOPE = motes.solid.Plane(position=(0, 0, -2.5), rotation=(0, -20, 0))
UP = np.array([-np.sin(np.radians(20)), 0.0, np.cos(np.radians(20))])
"""Normal of the slope; that of a curved solid is taken from places around, to a thousandth."""


def over_slope(x: Array) -> Array:
    return ((x - SLOPE.position) @ UP)[:, None]


def cruise(x: Array, v: Array) -> Array:
    return (3.0 - size_of(v)) / 0.7 * v / size_of(v)


def goal(x: Array, v: Array) -> Array:
    way = np.array([1.0, 1.0, 0.5]) * (np.array([2.0, -1.0, 3.0]) - x)
    wanted = 1.7 * np.minimum(1, size_of(way) / 2.5) * way / size_of(way)
    return (wanted - v) / 0.4


def homing(x: Array, v: Array) -> Array:
    stretch = np.array([1.0, 0.5, 2.0])
    own = (x - (0.5, 0.0, -0.5)) / stretch
    far = np.maximum(size_of(own) / 1.5 - 1, 0)
    return -2.5 * far * own / size_of(own) / stretch


def level(x: Array, v: Array) -> Array:
    z, vz = x[:, 2], v[:, 2]
    off = np.where(z < -0.8, z + 0.8, np.where(z > 0.6, z - 0.6, 0))
    leaving = off * vz > 0
    a = np.zeros_like(x)
    a[:, 2] = -off / 0.8**2 - np.where(leaving, 2 * vz / 0.8, 0)
    return a


def hover(x: Array, v: Array) -> Array:
    return ((1.4 - over_slope(x)) / 0.6 - 2 * (v @ UP)[:, None]) / 0.6 * UP


def avoid(x: Array, v: Array) -> Array:
    """w / 2 (w / g - 1 / horizon) (n + s) while above 0, s along the surface, a little to a side;
    w^2 / 2 g of it stops within g, and the part along the surface keeps the speed."""
    gap, n = over_slope(x), UP
    w = np.maximum(-(v @ n)[:, None], 0)
    g = np.maximum(gap - 0.3, 0.003)
    early = np.where(gap - 0.3 > 0.003, 1 / 2.5, 0)
    along = v + w * n + 0.05 * w * np.cross([0.0, 0.0, 1.0], n)
    way = np.minimum(w / size_of(along), 1) * along / size_of(along)
    return 0.5 * w * np.maximum(w / g - early, 0) * (n + way)


FORCES: dict[str, tuple[Any, Formula]] = {
    "cruise": (motes.force.Cruise(speed=3.0, response=0.7), cruise),
    "goal": (
        motes.force.Goal(place=(2, -1, 3), speed=1.7, arrival=2.5, response=0.4, along=(1, 1, 0.5)),
        goal,
    ),
    "homing": (
        motes.force.Homing(center=(0.5, 0, -0.5), radius=1.5, strength=2.5, stretch=(1, 0.5, 2)),
        homing,
    ),
    "level": (motes.force.Level(low=-0.8, high=0.6, response=0.8), level),
    "hover": (motes.force.Hover(height=1.4, response=0.6), hover),
    "avoid": (motes.force.Avoid(margin=0.3, horizon=2.5), avoid),
}


@pytest.mark.parametrize("name", FORCES)
def test_a_steering_force_is_its_formula(name: str) -> None:
    """Sixty birds over a slope, each alone."""
    force, formula = FORCES[name]
    x, v, a = kick(scene([birds(force=[force])], solid=[SLOPE]), "birds")
    free = over_slope(x)[:, 0] > 1e-3
    assert free.sum() > 50
    expected = formula(x, v)
    assert np.abs(expected).max() > 1
    assert a[free] == pytest.approx(expected[free], rel=2e-5, abs=1e-5)


def test_agility_is_what_a_body_can_do() -> None:
    """A pull, cut to limits along the way, across it, and in all."""
    limits = motes.force.Agility(least_speed=1.5, top_speed=3.0, turn=70.0, thrust=6.0,
                                 response=0.5)  # fmt: skip
    pull = motes.force.Homing(radius=0.1, strength=0.5)
    x, v, a = kick(scene([birds(force=[limits, pull])]), "birds")
    wanted = -0.5 * np.maximum(size_of(x) / 0.1 - 1, 0) * x / size_of(x)
    speed, way = size_of(v), v / size_of(v)
    along = (wanted * way).sum(axis=1, keepdims=True)
    across = wanted - along * way
    most = np.radians(70) * np.maximum(speed, 1.5)
    side = np.minimum(1, most / size_of(across)) * across
    along = np.maximum(np.minimum(along, (3.0 - speed) / 0.5), (1.5 - speed) / 0.5)
    whole = side + along * way
    expected = np.minimum(1, 6.0 / size_of(whole)) * whole
    assert a == pytest.approx(expected, rel=2e-5, abs=1e-5)
    for limited in (size_of(across) > most, speed > 3.0, speed < 1.5, size_of(whole) > 6.0):
        assert 3 < limited.sum() < 58


def test_nearly_head_on_a_wall_is_left_as_it_is_written() -> None:
    """With avoidance alone the speed w towards a floor follows the gap g less the margin as
    w = C sqrt(g) - g / horizon, the solution of dw/dg = (w / g - 1 / horizon) / 2, however far the
    way is from the normal; the speed as a whole stays."""
    floor, force = motes.solid.Plane(), motes.force.Avoid(margin=0.5, horizon=2.0)
    for aside in (0.0, 3.0):
        emitter = motes.emit.Point(
            position=(0, 0, 3.5), velocity=(aside, 0, -2.0), burst=[{"count": 1}]
        )
        bird = motes.System("bird", emit=[emitter], force=[force])
        sim = motes.Simulation(scene([bird], solid=[floor], integrator="rk4", step=0.002))
        rate = (2.0 + 3.0 / 2.0) / np.sqrt(3.0)
        for _ in range(8):
            sim.run(steps=60)
            g, v = sim["bird"].position[0, 2] - 0.5, sim["bird"].velocity[0]
            assert -v[2] == pytest.approx(rate * np.sqrt(g) - g / 2.0, rel=1e-6)
            if aside:
                assert np.linalg.norm(v) == pytest.approx(np.hypot(aside, 2.0), rel=1e-6)
        assert g < 1.5


def test_wandering_is_as_strong_and_as_long_as_it_says() -> None:
    """Mean square of strength^2 (1 - 2 c), c = integral of s (1 - s) over a time from one
    direction to the next, s = 6 u^5 - 15 u^4 + 10 u^3; c strength^2 is the covariance with what
    comes a whole such time later, and none is left after two."""
    u = (np.arange(1000) + 0.5) / 1000
    s = u**3 * (u * (6 * u - 15) + 10)
    c = float(np.mean(s * (1 - s)))
    wander = motes.force.Wander(strength=4.0, time=0.5, along=(1, 0.5, 1))
    crowd = birds(20000, force=[wander], velocity={"low": [0] * 3, "high": [0] * 3})
    sim = motes.Simulation(scene([crowd], step=0.05))
    speeds, kicks = np.zeros((20000, 3)), []
    for _ in range(21):
        sim.run(steps=1)
        now = sim["birds"].velocity[np.argsort(sim["birds"].id)]
        kicks.append((now - speeds) / 0.05 / (4.0 * np.array([1, 0.5, 1])))
        speeds = now
    square = [float((kicks[0] * kicks[k]).sum(axis=1).mean()) for k in (0, 10, 20)]
    assert square == pytest.approx([1 - 2 * c, c, 0.0], abs=0.02)


def hunt(**settings: Any) -> motes.Scene:
    prey = birds(12, "prey", size=(6, 6, 6))
    return scene([prey, birds(5, "hunters", size=(6, 6, 6))], **settings)


def both(found: motes.Scene, name: str) -> tuple[Array, ...]:
    other = "prey" if name == "hunters" else "hunters"
    x, v, a = kick(found, name)
    y, u, _ = kick(found, other)
    return x, v, a, y[None] - x[:, None], u[None] - v[:, None], u


@pytest.mark.parametrize("foresight", [0.0, 0.4, 5.0])
def test_pursuit_is_its_formula(foresight: float) -> None:
    """Five hunters see those of twelve that are within 5 m, where these will be."""
    law = motes.interact.Pursue(systems=["hunters"], sources=["prey"], strength=7.0, radius=5.0,
                                foresight=foresight)  # fmt: skip
    _, v, a, way, faster, _ = both(hunt(interact=[law]), "hunters")
    d = size_of(way)
    ahead = np.minimum(d / size_of(v)[:, None], foresight)
    weight = np.where(d < 5.0, (1 - d / 5.0) ** 2 / d**2, 0)
    aim = (weight * (way + faster * ahead)).sum(axis=1)
    assert a == pytest.approx(7.0 * aim / size_of(aim), rel=2e-5, abs=1e-5)


@pytest.mark.parametrize("foresight", [0.0, 0.4, 5.0])
def test_evasion_is_its_formula(foresight: float) -> None:
    """Twelve flee from those of five hunters that are within 4 m."""
    law = motes.interact.Evade(systems=["prey"], sources=["hunters"], strength=7.0, radius=4.0,
                               foresight=foresight)  # fmt: skip
    _, _, a, way, faster, u = both(hunt(interact=[law]), "prey")
    d = size_of(way)
    away = -way - faster * np.minimum(d / size_of(u)[None], foresight)
    expected = (np.where(d < 4.0, 1 - d / 4.0, 0) * away / size_of(away)).sum(axis=1)
    assert np.abs(expected).max() > 0.3
    assert a == pytest.approx(7.0 * expected, rel=2e-5, abs=1e-5)


def test_following_is_its_formula() -> None:
    """Twelve follow five leaders, as far as they see them."""
    law = motes.interact.FollowLeader(systems=["prey"], sources=["hunters"], behind=1.5,
                                      radius=5.0, response=0.8)  # fmt: skip
    _, _, a, way, faster, u = both(hunt(interact=[law]), "prey")
    weight = np.maximum(1 - size_of(way) / 5.0, 0)
    total = np.maximum(weight.sum(axis=1), 1e-6)
    place = (weight * (way - 1.5 * (u / size_of(u))[None])).sum(axis=1) / total
    speed = (weight * faster).sum(axis=1) / total
    assert a == pytest.approx(place / 0.8**2 + 2 * speed / 0.8, rel=2e-5, abs=1e-5)
