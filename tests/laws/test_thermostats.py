"""Laws of thermostats: temperatures that they hold, velocities that they forget."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_matter import atoms

import motes


def test_langevin_holds_the_temperature_and_forgets_velocities() -> None:
    """<v v> = k T / m within 4 standard errors, correlation e^(-friction t), for any threads."""
    n, temperature = 20_000, 0.7
    bath = motes.interact.Langevin(energy=temperature, friction=2.0)
    start = np.tile([3.0, 0.0, 0.0], (n, 1))
    ends, before = [], motes.threads()
    try:
        for threads in (1, 2):
            motes.threads(threads)
            sim = atoms(bath, np.zeros((n, 3)), start, step=0.05)
            sim.run(steps=10)
            ends.append(sim["atoms"].velocity.copy())
    finally:
        motes.threads(before)
    assert (ends[0] == ends[1]).all()
    v = ends[0]
    kept = math.exp(-2.0 * 0.5)
    spread = math.sqrt(temperature * (1 - kept**2))
    assert v.mean(axis=0) == pytest.approx([3 * kept, 0, 0], abs=4 * spread / math.sqrt(n))
    assert v.std(axis=0) == pytest.approx([spread] * 3, rel=4 / math.sqrt(2 * n))


def shaken(
    energy: float, friction: float, mass: float, steps: int = 1, v: Any = 0.0, moved: bool = False
) -> Any:
    """Velocities (n, 3) after steps of 0.05 s in a bath, in the order of ids."""
    bath = motes.interact.Langevin(energy=energy, friction=friction)
    scene = motes.Scene(
        systems=[motes.System("atoms", mass=mass)], interact=[bath], step=0.05,
        integrator="leapfrog", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("atoms", np.zeros((100_000, 3)), v)
    if moved:
        rows = sim._state.systems["atoms"]
        rows.reorder(np.random.default_rng(2).permutation(rows.count).astype(np.int32))
    sim.run(steps=steps)
    return sim["atoms"].velocity[np.argsort(sim["atoms"].id)]


def test_langevin_solves_its_equation_over_a_step() -> None:
    """v = c v + sqrt((1 - c^2) k T / m) xi, c = e^(-friction h), xi normal, new on every axis."""
    still = shaken(0.0, 2.0, 3.0, v=(3.0, -1.0, 2.0))
    np.testing.assert_allclose(still, np.exp(-0.1) * np.tile([3.0, -1.0, 2.0], (100_000, 1)), 1e-14)
    spread = math.sqrt((1 - math.exp(-0.2)) * 0.7 / 3.0)
    xi = shaken(0.7, 2.0, 3.0) / spread
    other = shaken(1.1, 0.5, 0.25) / math.sqrt((1 - math.exp(-0.05)) * 1.1 / 0.25)
    assert other == pytest.approx(xi, rel=1e-12)
    assert (shaken(0.7, 2.0, 3.0, moved=True) / spread == xi).all()  # It hangs on particles.
    n = len(xi)
    assert np.abs(xi.mean(axis=0)).max() < 4 / math.sqrt(n)
    assert (xi**2).mean() == pytest.approx(1, abs=4 * math.sqrt(2 / (3 * n)))
    assert (xi**4).mean() == pytest.approx(3, abs=4 * math.sqrt(96 / (3 * n)))
    later = (shaken(0.7, 2.0, 3.0, steps=2) / spread - math.exp(-0.1) * xi)[:, 0]
    four = np.corrcoef(np.vstack([xi.T, later]))
    assert np.abs(four[np.triu_indices(4, 1)]).max() < 4 / math.sqrt(n)


def test_rescale_sets_the_temperature() -> None:
    """At once, or by 1 - (1 - h/time)^k of the way; the mean velocity stays."""
    v = np.random.default_rng(1).normal(size=(500, 3)) + np.array([5.0, 0.0, 0.0])
    dof = 3 * 500 - 3
    for time, share in ((0.0, 1.0), (0.1, 1 - (1 - 0.005 / 0.1) ** 10)):
        sim = atoms(motes.interact.Rescale(energy=2.5, time=time), np.zeros((500, 3)), v)
        sim.run(steps=10)
        now = sim["atoms"].velocity
        before = ((v - v.mean(axis=0)) ** 2).sum() / dof
        after = ((now - now.mean(axis=0)) ** 2).sum() / dof
        assert after == pytest.approx(before + share * (2.5 - before), rel=1e-9)
        assert now.mean(axis=0) == pytest.approx(v.mean(axis=0), abs=1e-12)


def test_rescale_weighs_systems_by_their_mass() -> None:
    """Momentum stays; 2 E_kin about the mean velocity over 3 N - 3 is what was asked for."""
    rng, mass = np.random.default_rng(4), {"light": 0.5, "heavy": 7.0}
    scene = motes.Scene(
        systems=[motes.System(name, mass=m) for name, m in mass.items()],
        interact=[motes.interact.Rescale(energy=1.3)], step=0.01, integrator="leapfrog",
        precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("light", np.zeros((30, 3)), rng.normal(2.0, 1.0, (30, 3)))
    sim.place("heavy", np.zeros((20, 3)), rng.normal(-1.0, 1.0, (20, 3)))
    before = sim.measure().momentum
    sim.run(steps=1)
    assert sim.measure().momentum == pytest.approx(before, rel=1e-12, abs=1e-12)
    mean = before / (30 * 0.5 + 20 * 7.0)
    twice = sum(m * ((sim[name].velocity - mean) ** 2).sum() for name, m in mass.items())
    assert twice / (3 * 50 - 3) == pytest.approx(1.3, rel=1e-12)


def test_temperature_counts_what_can_move() -> None:
    """2 E_kin / dof: 3 N in open space, 3 N - 3 where the total momentum is constant."""
    x, v = np.arange(15.0).reshape(5, 3), np.random.default_rng(6).normal(size=(5, 3))
    for size, dof in (((0, 0, 0), 15), ((0, 50.0, 0), 12), ((50.0,) * 3, 12)):
        sim = atoms(motes.interact.LennardJones(), x, v, size=size)
        assert motes.matter.temperature(sim) == pytest.approx((v**2).sum() / dof, rel=1e-13)
        assert math.isnan(motes.matter.pressure(sim)) == (0 in size)
