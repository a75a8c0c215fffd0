"""Laws of the emitters of stars and planets, on their kernels' births."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, quad

import motes
from motes.emit.plummer import share_below


def born(emitter: Any, mass: float = 1.0) -> motes.simulation.View:
    """The newborns of an emitter's bursts, as they are at birth."""
    scene = motes.Scene(
        systems=[motes.System("bodies", emit=[emitter], mass=mass)],
        precision="double",
        step=1e-9,
        seed=5,
    )
    simulation = motes.Simulation(scene)
    simulation.run(steps=1)
    return simulation["bodies"]


def parts(emitter: Any) -> tuple[np.ndarray, np.ndarray]:
    view = born(emitter)
    return view.position.copy(), view.velocity.copy()


def elements(x: np.ndarray, v: np.ndarray, mu: float) -> tuple[Any, ...]:
    """a, e, inclination, node and pericentre [degrees] of states (n, 3), by their definitions."""
    r = np.linalg.norm(x, axis=1)
    h = np.cross(x, v)
    toward = np.cross(v, h) / mu - x / r[:, None]
    e = np.linalg.norm(toward, axis=1)
    a = 1.0 / (2.0 / r - (v**2).sum(axis=1) / mu)
    inclination = np.arccos(h[:, 2] / np.linalg.norm(h, axis=1))
    ascending = np.cross([0.0, 0.0, 1.0], h)
    node = np.arctan2(ascending[:, 1], ascending[:, 0])
    side = np.cross(h, ascending) / np.linalg.norm(h, axis=1)[:, None]
    pericentre = np.arctan2((toward * side).sum(axis=1), (toward * ascending).sum(axis=1))
    return a, e, *(np.degrees(angle) % 360 for angle in (inclination, node, pericentre))


def test_a_kepler_orbit_has_its_elements() -> None:
    emitter = motes.emit.KeplerOrbit(
        burst=[{"count": 200}], mu=3.0, semi_major_axis=2.0, eccentricity=0.6, inclination=35,
        node=70, pericentre=200, anomaly={"low": 0, "high": 360},
    )  # fmt: skip
    found = elements(*parts(emitter), 3.0)
    for values, wanted in zip(found, (2.0, 0.6, 35, 70, 200), strict=True):
        assert values == pytest.approx(np.full(200, wanted), rel=1e-6)


def test_every_element_may_be_random() -> None:
    emitter = motes.emit.KeplerOrbit(
        burst=[{"count": 500}], mu=1.0, semi_major_axis={"low": 1, "high": 3},
        eccentricity={"low": 0.1, "high": 0.9}, inclination={"low": 5, "high": 50},
        node={"low": 0, "high": 360}, pericentre={"low": 0, "high": 360},
        anomaly={"low": -360, "high": 720},
    )  # fmt: skip
    a, e, inclination, node, pericentre = elements(*parts(emitter), 1.0)
    for values, low, high in ((a, 1, 3), (e, 0.1, 0.9), (inclination, 5, 50)):
        assert low < values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() < high
    for values in (node, pericentre):  # 500 uniform angles: standard error 4.6 degrees.
        assert values.mean() == pytest.approx(180, abs=25)


def test_mean_anomaly_runs_evenly_in_time() -> None:
    """E - e sin(E) = M: born at M, a body is after M / 360 periods where it would be from 0."""
    e, period = 0.7, 2.0 * np.pi

    def at(mean: float, rest: float) -> np.ndarray:
        emitter = motes.emit.KeplerOrbit(burst=[{"count": 1}], eccentricity=e, anomaly=mean)
        centre = motes.force.Attractor(strength=1.0, softening=0.0)
        system = motes.System("body", emit=[emitter], force=[centre])
        scene = motes.Scene(
            systems=[system], precision="double", step=rest / 4000, integrator="rk4"
        )
        simulation = motes.Simulation(scene)
        simulation.run(steps=4000)
        return simulation["body"].position[0].copy()

    assert at(100.0, period * 260 / 360) == pytest.approx([1.0 - e, 0.0, 0.0], abs=1e-7)


def test_the_plummer_integral_is_closed() -> None:
    """d/dq of the closed form is q^2 (1 - q^2)^(7/2)."""
    for q in (0.05, 0.3, 0.7, 1.0):
        wanted = quad(lambda s: s**2 * (1 - s**2) ** 3.5, 0, q, epsabs=1e-14)[0]
        assert share_below(np.arcsin(q)) == pytest.approx(wanted, rel=1e-7)


def test_plummer_stars_have_its_distribution() -> None:
    """M(r) = (1 + r^-2)^(-3/2), q^2 (1 - q^2)^(7/2): gaps of n stars below 1.95 / sqrt(n)."""
    n = 20_000
    x, v = parts(motes.emit.Plummer(burst=[{"count": n}], cutoff=1e3))
    r = np.linalg.norm(x, axis=1)
    q = np.linalg.norm(v, axis=1) / np.sqrt(2.0) * (1.0 + r**2) ** 0.25
    ranks, bound = np.arange(n) / n, 1.95 / np.sqrt(n)  # Kolmogorov: passed by chance in 0.1 %.
    assert np.abs((1.0 + np.sort(r) ** -2.0) ** -1.5 - ranks).max() < bound
    grid = np.linspace(0, 1, 2000)
    below = cumulative_trapezoid(grid**2 * (1 - grid**2) ** 3.5, grid, initial=0)
    assert np.abs(np.interp(np.sort(q), grid, below / below[-1]) - ranks).max() < bound
    for directions in (x / r[:, None], v / np.linalg.norm(v, axis=1)[:, None]):
        assert np.abs(directions.mean(axis=0)).max() < 4.0 / np.sqrt(3 * n)
    assert 0.5 * (v**2).sum() / n == pytest.approx(3 * np.pi / 64, rel=0.02)


def test_a_disc_is_exponential_and_turns_with_its_centre() -> None:
    n, soft = 20_000, 0.4
    emitter = motes.emit.DiscGalaxy(
        burst=[{"count": n}], mu=2.0, softening=soft, scale=1.5, outer=5, height=0
    )
    x, v = parts(emitter)
    r = np.hypot(x[:, 0], x[:, 1])
    inside = lambda s: 1.0 - (1.0 + s) * np.exp(-s)  # noqa: E731
    gap = np.abs(inside(np.sort(r) / 1.5) / inside(5.0) - np.arange(n) / n).max()
    assert gap < 1.95 / np.sqrt(n)
    turning = (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0]) / r
    assert turning == pytest.approx(r * np.sqrt(2.0 * (r**2 + soft**2) ** -1.5), rel=1e-7)
    assert (x[:, :2] * v[:, :2]).sum(axis=1) == pytest.approx(0, abs=1e-7)


def test_the_stars_of_a_disc_wander_in_the_ratio_of_epicycles() -> None:
    """sigma_R = share Omega R; sigma_phi / sigma_R = kappa / (2 Omega), kappa^2 from Omega(R)."""
    soft, share = 0.4, 0.1
    birth = motes.emit.DiscGalaxy.kernel("birth")
    p = SimpleNamespace(
        mu=1.0, softening=soft, scale=1.0, inner=0.0, outer=5.0, height=0.0, dispersion=share
    )
    for u in np.random.default_rng(2).random((20, 6)):
        x, y, _, vx, vy, _ = birth(p, u, 0.0, 1)
        r = np.hypot(x, y)
        square = lambda s: (s**2 + soft**2) ** -1.5  # noqa: E731
        omega, step = np.sqrt(square(r)), 1e-4 * r
        slope = (square(r + step) - square(r - step)) / (2 * step)
        kappa = np.sqrt(r * slope + 4 * square(r))
        length, angle = np.sqrt(-2 * np.log(1 - u[4])), 2 * np.pi * u[5]  # Box and Muller.
        sigma = share * omega * r
        assert (x * vx + y * vy) / r == pytest.approx(sigma * length * np.cos(angle), abs=1e-9)
        ahead = sigma * kappa / (2 * omega) * length * np.sin(angle)
        assert (x * vy - y * vx) / r == pytest.approx(omega * r + ahead, rel=1e-7)


def test_a_disc_stays_as_it_is_around_its_centre() -> None:
    """Epicycles and vertical oscillations keep radii, thickness and dispersion."""
    emitter = motes.emit.DiscGalaxy(
        burst=[{"count": 4000}], softening=0.3, scale=0.5, outer=4, height=0.03, dispersion=0.05,
        direction=(1.0, 0.0, 1.0),
    )  # fmt: skip
    centre = motes.force.Attractor(strength=1.0, softening=0.3)
    system = motes.System("stars", emit=[emitter], force=[centre])
    scene = motes.Scene(systems=[system], precision="double", step=0.02, integrator="leapfrog")
    simulation = motes.Simulation(scene)
    simulation.run(steps=1)
    axis = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)

    def shape() -> np.ndarray:
        x = simulation["stars"].position
        z = x @ axis
        return np.array([*np.percentile(np.linalg.norm(x, axis=1), (20, 50, 80)), z.std()])

    before = shape()
    simulation.run(steps=600)
    assert shape() == pytest.approx(before, rel=0.05)  # Epicycles beyond the first order: e^2.
