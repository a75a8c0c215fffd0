"""Laws of motion, through the whole engine: document, compiler, births, steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

import motes

G = 9.81


def one_particle(
    *,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    system: dict | None = None,
    **scene: object,
) -> motes.Simulation:
    """A scene with one particle, born at time 0."""
    emitter = motes.emit.Point(
        burst=[{"at": 0.0, "count": 1}], position=position, velocity=velocity
    )
    settings = {"precision": "double", "duration": 10.0, **scene}
    return motes.Simulation(
        motes.Scene(systems=[motes.System("ball", emit=[emitter], **(system or {}))], **settings)
    )


def keys(*pairs: tuple[float, object]) -> dict:
    """A curve over time that is one cubic from the first key to the last."""
    return {"over": "time", "keys": [list(p) for p in pairs], "interpolation": "smooth"}


def test_euler_leaves_the_circle_by_its_exact_factor() -> None:
    """On x' = (-y, x) Euler multiplies the radius by sqrt(1 + h^2) every step."""
    step, n = 0.05, 100
    sim = one_particle(
        position=(1.0, 0.0, 0.0),
        flow=[motes.flow.Rotation(rate=1.0)],
        integrator="euler",
        step=step,
    )
    sim.run(steps=n)
    radius = np.linalg.norm(sim["ball"].position[0, :2])
    assert radius == pytest.approx((1 + step**2) ** (n / 2), rel=1e-12)


@pytest.mark.parametrize("step", [0.01, 0.037, 0.2])
def test_a_bouncing_ball_keeps_its_times_at_any_step(step: float) -> None:
    """Dropped from 1 m, restitution 0.8: parabolas between impacts, at rest at 4.0637 s."""
    e, fall = 0.8, math.sqrt(2 / G)
    rest = fall * (1 + e) / (1 - e)
    assert rest == pytest.approx(4.063712769, abs=1e-8)

    def height(t: float) -> float:
        if t <= fall:
            return 1 - G * t * t / 2
        begin, speed = fall, e * G * fall
        while t > begin + 2 * speed / G and speed > 1e-9:
            begin, speed = begin + 2 * speed / G, e * speed
        return max(speed * (t - begin) - G * (t - begin) ** 2 / 2, 0.0)

    ground = motes.solid.Plane(restitution=e, friction=0.0)
    sim = one_particle(
        position=(0.0, 0.0, 1.0), force=[motes.force.Gravity()], solid=[ground], step=step
    )
    for _ in range(round(5.0 / step)):
        sim.step()
        # Bounces below a thousandth of a step are not resolved: g (h / 1000)^2 / 8 at most.
        tolerance = 1e-9 + G * (step * 2e-2) ** 2
        assert sim["ball"].position[0, 2] == pytest.approx(height(sim.time), abs=tolerance)
    assert abs(sim["ball"].velocity[0, 2]) < 1e-12


def test_friction_stops_a_sliding_particle() -> None:
    """Coulomb: a = -mu g, so it stops after v^2 / (2 mu g)."""
    mu, speed = 0.5, 2.0
    ground = motes.solid.Plane(restitution=0.0, friction=mu)
    sim = one_particle(
        velocity=(speed, 0.0, 0.0), force=[motes.force.Gravity()], solid=[ground], step=0.001
    )
    sim.run(until=0.2)
    assert sim["ball"].velocity[0, 0] == pytest.approx(speed - mu * G * 0.2, abs=2e-2)
    sim.run(until=1.0)
    assert sim["ball"].velocity[0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert sim["ball"].position[0, 0] == pytest.approx(speed**2 / (2 * mu * G), rel=5e-3)


def test_an_elastic_bounce_off_a_ball_mirrors_the_velocity() -> None:
    """v' = v - 2 (v . n) n, with n from the centre of the ball to the point of impact."""
    ball = motes.solid.Sphere(radius=1.0, restitution=1.0, friction=0.0)
    start, velocity = np.array([-3.0, 0.4, 0.2]), np.array([2.0, 0.0, 0.0])
    sim = one_particle(position=tuple(start), velocity=tuple(velocity), solid=[ball], step=0.05)
    sim.run(until=2.0)
    y, z = start[1], start[2]
    normal = np.array([-math.sqrt(1 - y * y - z * z), y, z])
    mirrored = velocity - 2 * (velocity @ normal) * normal
    assert sim["ball"].velocity[0] == pytest.approx(mirrored, abs=1e-7)
    hit = (normal[0] - start[0]) / velocity[0]
    expected = normal + mirrored * (2.0 - hit)
    assert sim["ball"].position[0] == pytest.approx(expected, abs=1e-6)


def test_a_rising_floor_gives_twice_its_speed() -> None:
    """An elastic impact on a surface of speed u: v' = 2 u - v."""
    floor = motes.solid.Plane(
        position={"over": "time", "keys": [[0, [0, 0, -1]], [2, [0, 0, 1]]]},
        restitution=1.0,
        friction=0.0,
    )
    sim = one_particle(velocity=(0.0, 0.0, -0.5), solid=[floor], step=0.013)
    sim.run(until=1.5)
    assert sim["ball"].velocity[0, 2] == pytest.approx(2 * 1.0 + 0.5, rel=1e-6)


def test_a_thin_fast_plate_is_not_missed() -> None:
    """A particle that crosses a plate of a twentieth of its step bounces off it."""
    plate = motes.solid.Box(size=(2.0, 2.0, 0.05), restitution=1.0, friction=0.0)
    sim = one_particle(
        position=(0.1, 0.2, 0.7), velocity=(0.0, 0.0, -10.0), solid=[plate], step=0.1
    )
    sim.run(steps=1)
    assert sim["ball"].velocity[0, 2] == pytest.approx(10.0)
    assert sim["ball"].position[0, 2] == pytest.approx(0.025 + (1.0 - 0.675), rel=1e-9)


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "leapfrog"])
@pytest.mark.parametrize("drag", ["Drag", "QuadraticDrag"])
def test_no_step_makes_drag_explode(integrator: str, drag: str) -> None:
    """A splitting integrates v' = -k (v - u) exactly: at k h = 1e7 it moves with the wind."""
    force = {
        "Drag": motes.force.Drag(rate=1e6, wind=(3.0, 0.0, 0.0)),
        "QuadraticDrag": motes.force.QuadraticDrag(k=1e6, wind=(3.0, 0.0, 0.0)),
    }[drag]
    sim = one_particle(velocity=(50.0, -20.0, 7.0), force=[force], integrator=integrator, step=10.0)
    sim.run(steps=3)
    assert sim["ball"].velocity[0] == pytest.approx([3.0, 0.0, 0.0], abs=1e-5)


def test_backward_euler_divides_stiff_drag_by_its_closed_form() -> None:
    """v1 = (v0 + h g) / (1 + h k) at h k = 1e6, to the rounding of single precision."""
    sim = one_particle(
        velocity=(8.0, 0.0, 0.0),
        force=[motes.force.Drag(rate=1e6), motes.force.Gravity()],
        integrator="backward_euler",
        step=1.0,
        precision="single",
    )
    sim.run(steps=3)
    assert sim["ball"].velocity[0, 2] == pytest.approx(-9.81e-6, rel=2e-6)
    assert abs(sim["ball"].velocity[0, 0]) < 1e-12


def test_drag_decays_exactly_in_a_splitting() -> None:
    """v = v0 exp(-k t / m) to rounding, at any step."""
    sim = one_particle(
        velocity=(1.0, 0.0, 0.0),
        force=[motes.force.Drag(rate=0.7)],
        integrator="semi_implicit_euler",
        step=0.5,
        system={"mass": 2.0},
    )
    sim.run(steps=6)
    assert sim["ball"].velocity[0, 0] == pytest.approx(math.exp(-0.7 * 3.0 / 2.0), rel=1e-12)


def test_terminal_speed_of_quadratic_drag() -> None:
    """k v^2 = m g."""
    sim = one_particle(force=[motes.force.Gravity(), motes.force.QuadraticDrag(k=0.3)], step=0.01)
    sim.run(until=5.0)
    assert -sim["ball"].velocity[0, 2] == pytest.approx(math.sqrt(G / 0.3), rel=1e-6)


def test_energy_of_an_orbit_stays_bounded_with_leapfrog() -> None:
    """Symplectic: the energy error of a Kepler orbit does not drift over 50 periods."""
    sun = motes.force.Attractor(strength=1.0, softening=0.0)
    sim = one_particle(
        position=(0.5, 0.0, 0.0),
        velocity=(0.0, math.sqrt(3.0), 0.0),  # pericentre of an orbit of axis 1, eccentricity 0.5
        force=[sun],
        integrator="leapfrog",
        step=2 * math.pi / 200,
    )

    def energy() -> float:
        x, v = sim["ball"].position[0], sim["ball"].velocity[0]
        return 0.5 * float(v @ v) - 1 / float(np.linalg.norm(x))

    def worst(periods: int) -> float:
        errors = []
        for _ in range(periods * 20):
            sim.run(steps=10)
            errors.append(abs(energy() + 0.5) / 0.5)
        return max(errors)

    first = worst(5)
    sim.run(steps=200 * 40)
    later = worst(5)
    assert first == pytest.approx(2.689e-3, rel=0.05)  # published for 200 steps a period
    assert later == pytest.approx(first, rel=0.05)
