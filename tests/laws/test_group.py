"""Laws of systems that feel each other: every stage is taken by the whole group."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import component, quantity


@component(kind="interact", name="test_pull")
class Pull:
    """Gravity with G = 1, as a plain double loop over pairs."""

    strength = quantity(1.0, "m3/(kg s2)", scope="scene")
    """G."""

    def accelerations(p: Any, bodies: Any) -> Any:
        x = np.concatenate([b.position for b in bodies], axis=1).astype(float)
        m = np.concatenate([b.mass for b in bodies]).astype(float)
        away = x[:, None, :] - x[:, :, None]
        r2 = (away**2).sum(axis=0)
        np.fill_diagonal(r2, np.inf)
        total = p.strength * (away * (m / r2**1.5)[None]).sum(axis=2)
        ends = np.cumsum([b.mass.size for b in bodies])[:-1]
        return np.split(total, ends, axis=1)


def pair(integrator: str, step: float, **changes: Any) -> motes.Simulation:
    """Two bodies of masses 1 and 3 in two systems, on an orbit of eccentricity 0.3 around rest."""

    def body(name: str, share: float, mass: float) -> motes.System:
        speed = math.sqrt(4.0 * 1.3 / 0.7)  # At the pericentre 1 - e of an orbit with G M = 4.
        emitter = motes.emit.Point(
            burst=[{"count": 1}],
            position=(share * 0.7, 0.0, 0.0),
            velocity=(0.0, share * speed, 0.0),
        )
        return motes.System(name, emit=[emitter], mass=mass)

    systems = [body("light", 0.75, 1.0), body("heavy", -0.25, 3.0)]
    settings = {"precision": "double", "integrator": integrator, "step": step, **changes}
    return motes.Simulation(motes.Scene(systems=systems, interact=[Pull()], **settings))


ORDERS = {
    "euler": 1, "semi_implicit_euler": 1, "midpoint": 2, "leapfrog": 2, "heun": 2, "rk4": 4,
    "implicit_midpoint": 2, "kencarp4": 4,
}  # fmt: skip


@pytest.mark.parametrize(("integrator", "order"), ORDERS.items())
def test_a_group_has_the_order_of_its_method(integrator: str, order: int) -> None:
    """Taking one system through a step before the other would leave order 1 for every method."""

    def end(method: str, steps: int) -> np.ndarray:
        sim = pair(method, 1.0 / steps)
        sim.run(steps=steps)
        return np.concatenate([sim["light"].position[0], sim["heavy"].position[0]])

    exact = end("rk4", 2000)
    n = 100 if order == 4 else 400
    coarse, fine = (np.linalg.norm(end(integrator, k) - exact) for k in (n, 2 * n))
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.3)


def test_momentum_and_centre_of_mass_stay() -> None:
    """sum m v and sum m x are constant to rounding, for every method, at any step."""
    for integrator in ORDERS:
        sim = pair(integrator, 0.05)
        sim.run(steps=40)
        momentum = sim["light"].velocity[0] + 3 * sim["heavy"].velocity[0]
        centre = sim["light"].position[0] + 3 * sim["heavy"].position[0]
        assert momentum == pytest.approx(0.0, abs=1e-12)
        assert centre == pytest.approx(0.0, abs=1e-12)


def test_systems_that_are_not_named_feel_nothing() -> None:
    emitter = motes.emit.Sphere(burst=[{"count": 2}], speed=1.0)
    systems = [motes.System(n, emit=[emitter]) for n in ("a", "b", "free")]
    scene = motes.Scene(
        systems=systems, interact=[Pull(systems=["a", "b"])], precision="double", seed=4
    )
    sim = motes.Simulation(scene)
    sim.run(steps=1)
    before = sim["free"].velocity.copy(), sim["a"].velocity.copy()
    sim.run(steps=20)
    assert (sim["free"].velocity == before[0]).all()
    assert (sim["a"].velocity != before[1]).all()


def test_groups_are_named_right() -> None:
    emitter = motes.emit.Point(burst=[{"count": 1}])
    system = motes.System("stars", emit=[emitter])
    with pytest.raises(motes.SceneError, match=r'no system "starz"\. Did you mean "stars"'):
        motes.Simulation(motes.Scene(systems=[system], interact=[Pull(systems=["starz"])]))
    other = motes.System("dust", emit=[emitter], integrator="euler")
    with pytest.raises(motes.SceneError, match="one integrator"):
        motes.Simulation(motes.Scene(systems=[system, other], interact=[Pull()]))
