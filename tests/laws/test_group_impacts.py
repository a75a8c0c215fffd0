"""Laws of systems that feel each other and meet solids."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import motes
from motes import catalog
from motes.catalog import component, quantity
from motes.kernel import kernel, sin, sqrt

G = 9.81


@component(kind="emit", name="test_lattice")
class Lattice:
    """The k-th atom at the k-th place of a cubic lattice, with a velocity that looks random."""

    spacing = quantity(1.3, "m", scope="scene")
    """Distance of neighbours."""

    @kernel
    def birth(p, u, t, k):
        i, j, m = k % 3, (k // 3) % 3, k // 9
        a = 3.0 * i + 5.0 * j + 7.0 * m
        x, y, z = p.spacing * (i - 1), p.spacing * (j - 1), p.spacing * (m - 1)
        return x, y, z, 3.0 * sin(a), 3.0 * sin(a + 1.0), 3.0 * sin(a + 2.0)


@component(kind="solid", name="test_vessel")
class Vessel:
    """The inside of a ball."""

    radius = quantity(3.0, "m", scope="scene")
    """Radius."""

    @kernel
    def distance(p, x, y, z):
        return p.radius - sqrt(x * x + y * y + z * z)


catalog._forget("solid", "test_vessel")  # Menus that other tests read do not name it.


@component(kind="interact", name="test_weight")
class Weight:
    """Something that pulls everything down, as an interaction."""

    g = quantity(G, "m/s2", scope="scene")
    """Acceleration."""

    def accelerations(p: Any, bodies: Any) -> Any:
        return [np.full(b.position.shape, 0.0) - [[0.0], [0.0], [p.g]] for b in bodies]


def gas(step: float) -> motes.Simulation:
    """27 atoms in a vessel with elastic walls, which all feel one another."""
    return motes.Simulation(
        motes.Scene(
            systems=[motes.System("gas", emit=[Lattice(burst=[{"count": 27}])])],
            interact=[motes.interact.LennardJones(cutoff=6.5)],
            solid=[Vessel(restitution=1.0, friction=0.0)],
            precision="double",
            integrator="leapfrog",
            step=step,
        )
    )


def test_elastic_walls_keep_a_gas_in_and_its_energy() -> None:
    """E is constant; the leapfrog's error stays bounded and falls with the step's square."""
    worst = []
    for step in (0.004, 0.002):
        sim = gas(step)
        sim.run(steps=1)
        start, errors = sim.measure().energy, []
        while sim.time < 2.0 - step / 2:
            sim.run(steps=5)
            errors.append(abs(sim.measure().energy - start))
        assert np.linalg.norm(sim["gas"].position, axis=1).max() <= 3.0 + 1e-6
        assert sim.impacts > 40
        worst.append(max(errors) / (0.5 * np.sum(np.array(sim["gas"].velocity) ** 2)))
    assert worst[1] < 1e-3
    assert worst[0] / worst[1] > 3


def fallen(time: float, restitution: float) -> tuple[float, float]:
    """Height and velocity of a ball that fell from 1 m at time 0."""
    speed, left = math.sqrt(2 * G), time
    first = math.sqrt(2 / G)
    if left < first:
        return 1 - G * left**2 / 2, -G * left
    left -= first
    while left > 2 * (up := restitution * speed) / G:
        left -= 2 * up / G
        speed = up
    return up * left - G * left**2 / 2, up - G * left


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4"])
def test_a_ball_pulled_by_an_interaction_bounces_as_in_the_books(integrator: str) -> None:
    """Between bounces z = v t - g t^2 / 2, and each bounce keeps the share e of the speed."""
    emitter = motes.emit.Point(burst=[{"count": 1}], position=(0.0, 0.0, 1.0))
    sim = motes.Simulation(
        motes.Scene(
            systems=[motes.System("ball", emit=[emitter])],
            interact=[Weight()],
            solid=[motes.solid.Plane(restitution=0.8, friction=0.0)],
            precision="double",
            integrator=integrator,
            step=0.037,
        )
    )
    for _ in range(4):
        sim.run(steps=11)
        height, speed = fallen(sim.time, 0.8)
        assert sim["ball"].position[0, 2] == pytest.approx(height, abs=1e-9)
        assert sim["ball"].velocity[0, 2] == pytest.approx(speed, abs=1e-9)
    assert sim.impacts == 2


def test_what_an_interaction_pulls_down_comes_to_rest_on_the_ground() -> None:
    """With e = 0.5 all bounces end within sqrt(2 / g) (1 + e) / (1 - e), and then z = 0."""
    emitter = motes.emit.Point(burst=[{"count": 1}], position=(0.0, 0.0, 1.0))
    sim = motes.Simulation(
        motes.Scene(
            systems=[motes.System("ball", emit=[emitter])],
            interact=[Weight()],
            solid=[motes.solid.Plane(restitution=0.5)],
            precision="double",
            step=0.02,
        )
    )
    sim.run(until=3 * math.sqrt(2 / G) + 0.1)
    assert abs(sim["ball"].position[0, 2]) < 1e-8
    assert np.linalg.norm(sim["ball"].velocity[0]) < 1e-8
