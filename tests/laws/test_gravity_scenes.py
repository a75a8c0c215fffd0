"""Laws of gravity in scenes: what a closed system keeps, and orbits that close."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import motes
from motes.production import film, open_frames


def simulation(*systems: motes.System, **settings: Any) -> motes.Simulation:
    settings = {"precision": "double", "integrator": "leapfrog", "seed": 3, **settings}
    return motes.Simulation(motes.Scene(systems=list(systems), **settings))


def body(name: str, mass: float, position: Any, velocity: Any) -> motes.System:
    emitter = motes.emit.Point(burst=[{"count": 1}], position=position, velocity=velocity)
    return motes.System(name, emit=[emitter], mass=mass)


def test_births_at_a_steps_begin_feel_the_whole_step() -> None:
    """Symplectic Euler from rest: v = a h after the first step, for sources and for tracers."""
    sim = simulation(
        body("left", 3.0, (-1, 0, 0), (0, 0, 0)),
        body("right", 1.0, (1, 0, 0), (0, 0, 0)),
        interact=[motes.interact.Gravity(G=1.0)], step=0.1, integrator="semi_implicit_euler",
    )  # fmt: skip
    sim.run(steps=1)
    assert sim["left"].velocity[0] == pytest.approx([0.1 * 1 / 4, 0, 0])
    assert sim["right"].velocity[0] == pytest.approx([-0.1 * 3 / 4, 0, 0])


def test_two_bodies_keep_their_period_and_shape() -> None:
    """T = 2 pi sqrt(a^3 / (G M)): after one period both are back, for an orbit of e = 0.5."""
    steps, e = 2000, 0.5
    speed = np.sqrt(4.0 * (1 + e) / (1 - e))
    sim = simulation(
        body("light", 1.0, (0.75 * (1 - e), 0, 0), (0, 0.75 * speed, 0)),
        body("heavy", 3.0, (-0.25 * (1 - e), 0, 0), (0, -0.25 * speed, 0)),
        interact=[motes.interact.Gravity(G=1.0)],
        integrator="yoshida4", step=2 * np.pi / np.sqrt(4.0) / steps,
    )  # fmt: skip
    sim.run(steps=steps // 2)
    assert sim["light"].position[0] == pytest.approx([-0.75 * (1 + e), 0, 0], abs=1e-6)
    sim.run(steps=steps // 2)
    assert sim["light"].position[0] == pytest.approx([0.75 * (1 - e), 0, 0], abs=1e-6)
    measures = sim.measure()
    assert measures.energy == pytest.approx(-3.0 / 2.0, rel=1e-7)  # -G m M / (2 a).
    h = 0.75 * np.sqrt(4.0 * (1 - e**2))  # The reduced mass times sqrt(G M a (1 - e^2)).
    assert measures.angular_momentum == pytest.approx([0, 0, h], rel=1e-12)
    assert measures.momentum == pytest.approx(0, abs=1e-12)


def test_tracers_are_pulled_and_do_not_pull() -> None:
    """A system that is no source goes around those that are, whatever its mass."""
    tracer = body("tracer", 5.0, (1, 0, 0), (0, 1, 0))
    sun = body("sun", 1.0, (0, 0, 0), (0, 0, 0))
    gravity = motes.interact.Gravity(G=1.0, sources=["sun"])
    sim = simulation(tracer, sun, interact=[gravity], step=2 * np.pi / 1000, integrator="yoshida4")
    sim.run(steps=250)
    assert sim["tracer"].position[0] == pytest.approx([0, 1, 0], abs=1e-6)
    assert (sim["sun"].position == 0).all()
    assert sim.measure().potential == pytest.approx(-5.0, rel=1e-6)
    with pytest.raises(motes.SceneError, match=r'no system "suns"\. Did you mean "sun"'):
        simulation(tracer, sun, interact=[motes.interact.Gravity(sources=["suns"])])
    apart = motes.interact.Gravity(systems=["tracer"], sources=["sun"])
    with pytest.raises(motes.SceneError, match='source "sun" does not take part'):
        simulation(tracer, sun, interact=[apart]).run(steps=1)


def test_a_tolerance_that_single_precision_cannot_keep_is_a_line_with_the_remedy() -> None:
    star = body("star", 1.0, (0, 0, 0), (0, 0, 0))
    fine = [motes.interact.Gravity(tolerance=1e-8)]
    with pytest.raises(motes.SimulationError, match=r'at least 1e-06 .* precision = "double"'):
        simulation(star, interact=fine, precision="single").run(steps=1)
    simulation(star, interact=fine).run(steps=1)


@pytest.mark.parametrize("method", ["position_verlet", "yoshida4", "rk4", "dopri5", "nystrom5"])
@pytest.mark.parametrize(("tolerance", "n"), [(0.0, 150), (1e-3, 2500)])
def test_measures_are_sums_over_all_systems(method: str, tolerance: float, n: int) -> None:
    """T, U and P of stars and gas that pull on each other, and of dust that only feels them.

    U = -G (sum over pairs of sources, once + dust in their field); dP/dt of the sources is 0.
    """
    stars, gas = (
        motes.System(name, mass=0.5 / n, emit=[motes.emit.Plummer(burst=[{"count": n}], mu=1.0)])
        for name in ("stars", "gas")
    )
    dust = motes.System("dust", mass=1e-3, emit=[motes.emit.Plummer(burst=[{"count": 40}])])
    sources = ("gas", "stars")
    law = motes.interact.Gravity(
        G=1.0, softening=0.1, softening_kernel="plummer", tolerance=tolerance, sources=sources
    )
    sim = simulation(stars, gas, dust, interact=[law], integrator=method, step=0.02)
    sim.run(steps=1)
    before = sum(0.5 / n * sim[name].velocity.sum(axis=0) for name in sources)
    sim.run(steps=4)
    after = sum(0.5 / n * sim[name].velocity.sum(axis=0) for name in sources)
    x = np.concatenate([sim[name].position for name in sources])

    def depth(places: np.ndarray) -> np.ndarray:
        apart = ((places[:, None] - x[None]) ** 2).sum(axis=2) + 0.1**2
        return (0.5 / n / np.sqrt(apart)).sum(axis=1)

    parts = np.concatenate([depth(part) for part in np.array_split(x, 20)])
    mutual = 0.5 * (0.5 / n) * (parts.sum() - 2 * n * (0.5 / n) / 0.1)
    potential = -mutual - 1e-3 * depth(sim["dust"].position).sum()
    kinetic = 0.5 * sum(
        m * (sim[name].velocity ** 2).sum()
        for name, m in (("stars", 0.5 / n), ("gas", 0.5 / n), ("dust", 1e-3))
    )
    measures = sim.measure()
    assert measures.mass == pytest.approx(1.04, rel=1e-12)
    assert measures.kinetic == pytest.approx(kinetic, rel=1e-12)
    assert measures.potential == pytest.approx(potential, rel=max(tolerance, 1e-12))
    assert measures.virial_ratio == pytest.approx(-2 * kinetic / potential, rel=1e-3)
    strength = 0.4  # Of a Plummer sphere of G M = a = 1, sum m |a| is about this.
    assert after - before == pytest.approx(0, abs=4 * 0.02 * strength * tolerance + 1e-14)


def test_a_tolerance_keeps_the_motion_of_direct_sums() -> None:
    """Accelerations within 1e-4 move stars from rest by at most that times a t^2 / 2, rms."""

    def stars(tolerance: float) -> np.ndarray:
        emitter = motes.emit.Sphere(burst=[{"count": 7000}], radius=1.0)
        law = motes.interact.Gravity(G=1.0, softening=0.05, tolerance=tolerance)
        sim = simulation(
            motes.System("stars", emit=[emitter], mass=1 / 7000), interact=[law], step=0.05
        )
        sim.run(steps=1)
        sim.run(steps=4)
        return np.array(sim["stars"].position)

    exact = stars(0.0)
    close, rough = (np.sqrt(((stars(t) - exact) ** 2).sum(axis=1).mean()) for t in (1e-4, 1e-2))
    assert close <= 1e-4 * 0.25**2 / 2
    assert close < rough


def test_measures_are_kept_beside_the_frames(tmp_path: Any) -> None:
    """What `measure` says of the last step before each frame, exactly."""
    scene = motes.Scene(
        systems=[
            body("light", 1.0, (1, 0, 0), (0, 1, 0)),
            body("heavy", 3.0, (-1, 0, 0), (0, 0, 0)),
        ],
        interact=[motes.interact.Gravity(G=1.0)],
        precision="double", integrator="leapfrog", step=1 / 24, duration=0.25,
    )  # fmt: skip
    film(scene, tmp_path, draw=False)
    kept = open_frames(tmp_path).measures()
    sim = motes.Simulation(scene)
    for frame in sim.frames():
        now = sim.measure()
        assert kept[frame.index].energy == now.energy
        assert kept[frame.index].time == now.time
        assert np.array_equal(kept[frame.index].momentum, now.momentum)
    assert len(kept) == sim.frame_count
    assert now.energy == pytest.approx(0.5 - 3 / 2, rel=1e-3)


def test_energy_of_forces_with_a_potential() -> None:
    """m v^2 / 2 + m g z of a thrown stone is constant; the momentum falls by m g t."""
    stone = body("stone", 2.0, (0, 0, 10), (3, 0, 4))
    sim = simulation(stone, force=[motes.force.Gravity()], step=0.01)
    sim.run(steps=100)
    measures = sim.measure()
    assert measures.energy == pytest.approx(2.0 * (25 / 2 + 9.81 * 10), rel=1e-12)
    assert measures.momentum == pytest.approx([6, 0, 8 - 2 * 9.81], rel=1e-12)
    assert measures.mass == 2.0
    assert np.isnan(simulation(body("free", 1, (0, 0, 0), (1, 0, 0))).measure().virial_ratio)


def test_a_plummer_sphere_stays_in_equilibrium() -> None:
    """Ten dynamical times sqrt(a^3 / (G M)): Lagrangian radii and 2T/|U| = 1 stay.

    The radii of n stars have a standard error of about 1 / sqrt(n), and relax by as much.
    """
    n = 1000
    emitter = motes.emit.Plummer(burst=[{"count": n}])
    gravity = motes.interact.Gravity(G=1.0, softening=0.03, softening_kernel="plummer")
    sim = simulation(
        motes.System("stars", emit=[emitter], mass=1 / n), interact=[gravity], step=0.04
    )
    sim.run(steps=1)
    start = sim.measure()

    def radii() -> np.ndarray:
        x = sim["stars"].position - sim.measure().center
        return np.percentile(np.linalg.norm(x, axis=1), (25, 50, 75))

    before = radii()
    assert before[1] == pytest.approx(1.3048, rel=3 / np.sqrt(n))
    assert start.virial_ratio == pytest.approx(1.0, abs=0.05)
    sim.run(steps=250)
    end = sim.measure()
    assert radii() == pytest.approx(before, rel=0.08)
    assert end.virial_ratio == pytest.approx(1.0, abs=0.05)
    assert end.energy == pytest.approx(start.energy, rel=2e-3)  # Leapfrog at h = 0.04: h^2.
    assert end.momentum == pytest.approx(start.momentum, abs=1e-12)
    assert end.angular_momentum == pytest.approx(start.angular_momentum, abs=1e-12)


def test_a_binary_inside_a_cluster_keeps_its_period() -> None:
    """Stars around add a tide of (a / r)^3 only: twenty periods later the phase is as alone."""
    separation, n = 0.004, 400
    speed = np.sqrt(0.02 / separation) / 2
    cluster = motes.emit.Plummer(burst=[{"count": n}], radius=1.0, mu=1.0)
    sim = simulation(
        motes.System("stars", emit=[cluster], mass=1 / n),
        body("one", 0.01, (separation / 2, 0, 0), (0, speed, 0)),
        body("two", 0.01, (-separation / 2, 0, 0), (0, -speed, 0)),
        interact=[motes.interact.Gravity(G=1.0, softening=0.0)],
        integrator="yoshida4",
        step=2 * np.pi * np.sqrt(separation**3 / 0.02) / 60,
    )
    crossings = 0
    before = None
    for _ in range(20 * 60):
        sim.run(steps=1)
        y = sim["one"].position[0, 1] - sim["two"].position[0, 1]
        crossings += before is not None and before < 0 <= y
        before = y
    apart = sim["one"].position[0] - sim["two"].position[0]
    assert crossings in (19, 20)
    assert np.linalg.norm(apart) == pytest.approx(separation, rel=0.02)
    assert np.degrees(np.arctan2(apart[1], apart[0])) == pytest.approx(0, abs=5)


OUTER = {
    # Mass [sun], and the state at 1994-09-05 [au, au/day], of Hairer, Lubich and Wanner, Geometric
    # Numerical Integration (2006), table I.2.2.
    "sun": (1.00000597682, (0, 0, 0), (0, 0, 0)),
    "jupiter": (
        0.000954786104043,
        (-3.5023653, -3.8169847, -1.5507963),
        (0.00565429, -0.00412490, -0.00190589),
    ),
    "saturn": (
        0.000285583733151,
        (9.0755314, -3.0458353, -1.6483708),
        (0.00168318, 0.00483525, 0.00192462),
    ),
    "uranus": (
        0.0000437273164546,
        (8.3101420, -16.2901086, -7.2521278),
        (0.00354178, 0.00137102, 0.00055029),
    ),
    "neptune": (
        0.0000517759138449,
        (11.4707666, -25.7294829, -10.8169456),
        (0.00288930, 0.00114527, 0.00039677),
    ),
    "pluto": (
        1 / 1.3e8,
        (-15.5387357, -25.2225594, -3.1902382),
        (0.00276725, -0.00170702, -0.00136504),
    ),
}


YEAR = 365.25
"""Days of a year, in which the simulation counts time."""


def test_the_outer_planets_keep_their_energy_and_orbits() -> None:
    """The energy error of a symplectic method is bounded, and falls as its order says."""

    def drift(step: float) -> float:
        systems = [
            body(name, mass, position, YEAR * np.array(velocity))
            for name, (mass, position, velocity) in OUTER.items()
        ]
        gravity = motes.interact.Gravity(G=2.95912208286e-4 * YEAR**2)
        sim = simulation(*systems, interact=[gravity], integrator="yoshida4", step=step / YEAR)
        energies = []
        for _ in range(20):
            sim.run(steps=round(2000 / step))
            energies.append(sim.measure().energy)
        distance = np.linalg.norm(sim["jupiter"].position[0] - sim["sun"].position[0])
        assert 4.9 < distance < 5.5  # Jupiter's perihelion and aphelion [au].
        return float(np.ptp(energies) / abs(energies[0]))

    coarse, fine = drift(100), drift(50)
    assert coarse < 5e-5
    assert np.log2(coarse / fine) == pytest.approx(4, abs=1)
