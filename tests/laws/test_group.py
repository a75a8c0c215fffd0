"""Laws of systems that feel each other: every stage is taken by the whole group."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import motes
from motes import catalog
from motes.catalog import component, quantity
from motes.errors import SimulationError
from motes.integrate import method, methods


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


HALVED = {1: 200, 2: 100, 3: 50, 4: 50, 5: 25, 6: 20, 8: 16, 9: 6}
"""Steps in a second by order, from which an error falls as the order says."""


@pytest.mark.parametrize("integrator", methods())
def test_a_group_has_the_order_of_its_method(integrator: str) -> None:
    """Taking one system through a step before the other would leave order 1 for every method."""

    def end(method: str, steps: int) -> np.ndarray:
        sim = pair(method, 1.0 / steps)
        sim.run(steps=steps)
        return np.concatenate([sim["light"].position[0], sim["heavy"].position[0]])

    order = method(integrator).order
    exact, n = end("verner9", 80), HALVED[order]
    coarse, fine = (np.linalg.norm(end(integrator, k) - exact) for k in (n, 2 * n))
    assert order - 0.3 < math.log2(coarse / fine) < order + (0.3 if order < 5 else 1.0)


@pytest.mark.parametrize("integrator", methods())
def test_momentum_and_centre_of_mass_stay(integrator: str) -> None:
    """sum m v and sum m x are constant to rounding, for every method, at any step."""
    # rodas4 takes differences of forces, which have a millionth of a force's digits.
    tolerance = 1e-11 if integrator == "rodas4" else 1e-13
    sim = pair(integrator, 0.05)
    sim.run(steps=20)
    momentum = sim["light"].velocity[0] + 3 * sim["heavy"].velocity[0]
    centre = sim["light"].position[0] + 3 * sim["heavy"].position[0]
    assert momentum == pytest.approx(0.0, abs=tolerance)
    assert centre == pytest.approx(0.0, abs=tolerance)


@pytest.mark.parametrize("integrator", ["kencarp3", "kencarp4"])
def test_a_split_group_pushes_explicitly_and_keeps_its_order(integrator: str) -> None:
    """Drag is stiff and taken implicitly, row by row; the pull is summed up once a stage."""

    def end(name: str, steps: int, stiff: bool = True) -> np.ndarray:
        drag = motes.force.Drag(rate=0.2, wind=(0.3, 0.0, 0.1), stiff=stiff)
        sim = pair(name, 1.0 / steps, force=[drag])
        sim.run(steps=steps)
        return np.concatenate([sim["light"].position[0], sim["heavy"].position[0]])

    exact = end("verner9", 80)
    coarse, fine = (np.linalg.norm(end(integrator, k) - exact) for k in (50, 100))
    assert math.log2(coarse / fine) == pytest.approx(method(integrator).order, abs=0.3)
    assert end(integrator, 20) != pytest.approx(end(integrator, 20, stiff=False), rel=1e-8)


@pytest.mark.parametrize("integrator", ["kencarp3", "kencarp4"])
def test_stiff_drag_in_a_split_group_bounds_no_step(integrator: str) -> None:
    """k = 1e6 / s at h = 0.1: bodies drift at some pull over k; taken explicitly they explode."""
    drag = motes.force.Drag(rate=1e6, stiff=True)
    sim = pair(integrator, 0.1, force=[drag])
    sim.run(steps=50)
    apart = sim["light"].position[0] - sim["heavy"].position[0]
    pull = 3.0 / float(apart @ apart)  # [N]
    speed = float(np.linalg.norm(sim["light"].velocity[0]))
    assert speed == pytest.approx(pull / 1e6, rel=0.2)  # The pull is that of a stage, not of now.


@component(kind="interact", name="test_net")
class Net:
    """Springs of rest length 1 between next neighbours of a square net."""

    stiffness = quantity(1e6, "N/m", scope="scene")
    """k."""

    def accelerations(p: Any, bodies: Any) -> Any:
        (body,) = bodies
        n = math.isqrt(body.mass.size)
        x = body.position.astype(float).reshape(3, n, n)
        total = np.zeros_like(x)
        for axis in (1, 2):
            way = np.diff(x, axis=axis)
            pull = p.stiffness * (1 - 1 / np.sqrt((way**2).sum(axis=0))) * way
            total += np.pad(pull, [(0, 0), *((0, int(a == axis)) for a in (1, 2))])
            total -= np.pad(pull, [(0, 0), *((int(a == axis), 0) for a in (1, 2))])
        return [total.reshape(3, -1) / body.mass]


catalog._forget("interact", "test_net")  # Menus that other tests read do not name it.


def net(integrator: str, step: float, precision: str, n: int = 4) -> motes.Simulation:
    """A net whose knots are off their places by a hundredth, in air."""
    scene = motes.Scene(
        systems=[motes.System("net")],
        interact=[Net()],
        force=[motes.force.Drag(rate=1.0)],
        integrator=integrator,
        step=step,
        precision=precision,
    )
    sim = motes.Simulation(scene)
    places = np.stack(np.meshgrid(range(n), range(n), [0], indexing="ij"), -1).reshape(-1, 3)
    sim.place("net", places + 0.01 * np.random.default_rng(1).normal(size=places.shape))
    return sim


def strain(sim: motes.Simulation) -> float:
    """The largest stretch of any spring."""
    n = math.isqrt(sim.count)
    x = sim["net"].position.T.reshape(3, n, n).astype(float)
    lengths = [np.sqrt((np.diff(x, axis=axis) ** 2).sum(axis=0)) for axis in (1, 2)]
    return max(float(np.abs(length - 1).max()) for length in lengths)


@pytest.mark.parametrize(
    ("integrator", "precision"),
    [
        ("backward_euler", "single"),
        ("bdf2", "double"),
        ("sdirk2", "single"),
        ("kencarp4", "double"),
        ("radau5", "double"),
    ],
)
def test_a_stiff_net_settles_where_explicit_methods_explode(
    integrator: str, precision: str
) -> None:
    """h w = 28 of the stiffest wave: the iteration of pushes diverges, Newton's method does not.

    At first every spring is off by some 0.02; L-stable methods damp that at once.
    """
    sim = net(integrator, 0.01, precision)
    assert strain(sim) > 0.02
    sim.run(steps=5)
    assert strain(sim) < 0.005
    momentum = sim["net"].velocity.astype(float).sum(axis=0)
    assert momentum == pytest.approx(0.0, abs=1e-9 if precision == "double" else 1e-1)


def test_rodas4_says_where_single_precision_is_too_coarse() -> None:
    """A stiff chain of a law with lists: h^2 k = 10, whose matrix wants finer differences."""
    scene = motes.Scene(
        systems=[motes.System("chain")],
        interact=[motes.interact.NearSpring(stiffness=1e5, length=1.0, breaking=1.5)],
        integrator="rodas4",
        step=0.01,
        precision="single",
    )
    sim = motes.Simulation(scene)
    places = np.zeros((20, 3))
    places[:, 0] = np.arange(20) + 1e-3 * np.random.default_rng(1).normal(size=20)
    sim.place("chain", places)
    with pytest.raises(SimulationError, match="single precision"):
        sim.run(steps=2)


def test_an_explicit_method_explodes_in_the_stiff_net() -> None:
    """rk4 bears h w < 2.8."""
    sim = net("rk4", 0.01, "double")
    sim.run(steps=6, checked=False)
    assert not strain(sim) < 1e6


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
