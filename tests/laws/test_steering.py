"""Laws of steering: limits, solids that are seen in time, what mixes with flocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.laws.boids import rules

import motes


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


OBSTACLES = {
    "sphere": motes.solid.Sphere(position=(5, 0.3, 0.2), radius=1.2),
    "box": motes.solid.Box(position=(5, 0.2, 0.1), size=(1.5, 2, 2)),
    "turned box": motes.solid.Box(position=(5, 0.2, 0.1), size=(2, 2, 2), rotation=(30, 40, 20)),
    "round box": motes.solid.Box(
        position=(5, -0.2, 0.1), size=(2, 1.5, 3), rounding=0.5, rotation=(0, 25, -50)
    ),
    "plane": motes.solid.Plane(position=(6, 0, 0), rotation=(0, -60, 0)),
    "two": None,
}


@pytest.mark.parametrize("kind", OBSTACLES)
def test_every_solid_is_steered_around_before_it_is_hit(kind: str) -> None:
    """A dozen birds side by side fly at a solid: none hits it, none stops, and without the force
    they would have hit it."""
    solids = [OBSTACLES[kind]] if OBSTACLES[kind] is not None else [
        motes.solid.Box(name="a", position=(5, 1.8, 0), size=(1, 2, 4), rotation=(0, 0, 30)),
        motes.solid.Sphere(name="b", position=(8, -1, 0), radius=1.4),
    ]  # fmt: skip
    impacts = {}
    for avoids in (True, False):
        forces: list[Any] = [motes.force.Cruise(speed=2.0)]
        forces += [motes.force.Avoid(margin=0.3, horizon=1.5)] if avoids else []
        emitters = [
            motes.emit.Point(
                name=f"e{k}", burst=[{"count": 1}], position=(0, 0.25 * k - 1.4, 0.13 * k - 0.7),
                velocity=(2, 0, 0),
            )
            for k in range(12)
        ]  # fmt: skip
        sim = motes.Simulation(motes.Scene(
            systems=[motes.System("birds", emit=emitters, force=forces)], solid=solids,
            precision="double", step=0.02, integrator="semi_implicit_euler",
        ))  # fmt: skip
        for _ in range(60):
            sim.run(steps=5)
            if avoids:
                speed = np.linalg.norm(sim["birds"].velocity, axis=1)
                assert (speed > 0.5).all()
        impacts[avoids] = sim.impacts
    assert impacts[True] == 0
    assert impacts[False] > 0
