"""Laws of motion under gravity: equilibrium, periods, energy."""

import math

import numpy as np
import pytest
from test_gravity import plummer_sphere

from motes import gravity


def leapfrog(x, v, acceleration, step, count):
    """Kick, drift, kick; yields the state after each step."""
    a = acceleration(x)
    for _ in range(count):
        v = v + step / 2 * a
        x = x + step * v
        a = acceleration(x)
        v = v + step / 2 * a
        yield x, v


def equilibrium(n):
    """A Plummer sphere with velocities from its distribution function, q^2 (1 - q^2)^(7/2).

    Source: Aarseth, Henon and Wielen, Astronomy and Astrophysics 37 (1974) 183.
    """
    x, m = plummer_sphere(n, seed=4)
    rng = np.random.default_rng(5)
    q, height = rng.random((2, 40 * n))
    q = q[0.1 * height < q**2 * (1 - q**2) ** 3.5][:n]
    way = rng.normal(size=(n, 3))
    escape = math.sqrt(2) * (1 + (x**2).sum(axis=1)) ** -0.25
    v = (q * escape / np.linalg.norm(way, axis=1))[:, None] * way
    return x - x.mean(axis=0), v - v.mean(axis=0), m


def test_a_plummer_sphere_stays_in_equilibrium():
    """Ten dynamical times (a^3 / G M)^(1/2): Lagrangian radii stay put, 2 T = |U|, E is kept.

    2 000 particles tell radii to n^(-1/2), 2 %; the rest is two-body relaxation.
    """
    x, v, m = equilibrium(2000)
    law = {"softening": 0.03}

    def energies(x, v):
        return (m * (v**2).sum(axis=1)).sum() / 2, (m * gravity.potential(x, m, **law)).sum() / 2

    def radii(x):
        return np.quantile(np.linalg.norm(x, axis=1), (0.25, 0.5, 0.75))

    kinetic, bound = energies(x, v)
    assert bound == pytest.approx(-3 * math.pi / 32, rel=0.05)
    assert 2 * kinetic == pytest.approx(-bound, rel=0.05)
    before, after, ratios = radii(x), [], []
    for k, (y, w) in enumerate(
        leapfrog(x, v, lambda x: gravity.acceleration(x, m, **law), 0.04, 250)
    ):
        if k % 25 == 24:
            end = energies(y, w)
            after.append(radii(y))
            ratios.append(-2 * end[0] / end[1])
    np.testing.assert_allclose(np.mean(after, axis=0), before, rtol=0.05)
    assert np.mean(ratios) == pytest.approx(1, abs=0.03)
    assert sum(end) == pytest.approx(kinetic + bound, rel=3e-3)
    assert np.abs((m[:, None] * (w - v)).sum(axis=0)).max() < 1e-13


def test_a_binary_in_a_cluster_keeps_its_period():
    """T = 2 pi (d^3 / G M)^(1/2), within the tide of the cluster, 2e-4, and the step's 7e-5.

    The pair is a millionth of the box apart: leaves hold it and much else.
    """
    x, m = plummer_sphere(1000)
    near = np.linalg.norm(x, axis=1) < 0.2
    x, m = x[~near], m[~near]
    d, mass, steps = 1e-3, 1e-4, 150
    period = 2 * math.pi * math.sqrt(d**3 / (2 * mass))
    speed = math.sqrt(2 * mass / d) / 2
    start = np.array([[d / 2, 0, 0], [-d / 2, 0, 0]])
    masses = np.concatenate([[mass, mass], m])

    def acceleration(pair):
        everything = np.concatenate([pair, x])
        return gravity.acceleration(everything, masses, tolerance=1e-5, method="multipole")[:2]

    velocity = np.array([[0, speed, 0], [0, -speed, 0]])
    *_, (end, _) = leapfrog(start, velocity, acceleration, period / steps, steps)
    way = end[0] - end[1]
    assert np.linalg.norm(way) == pytest.approx(d, rel=2e-3)
    assert math.atan2(way[1], way[0]) == pytest.approx(0, abs=2 * math.pi * 1e-3)
