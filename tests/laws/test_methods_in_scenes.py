"""Every time-stepping method through the whole engine: order, stability, what it refuses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from test_motion import keys, one_particle

import motes
from motes.catalog import catalog
from motes.errors import SceneError
from motes.integrate import method, methods

HALVED = {"tsit5": 32, "dop853": 8, "verner9": 4, "yoshida6": 32, "yoshida8": 32}
"""Steps a second from which an error falls as the order says, 128 for all others."""


def order_of(ends: Any, exact: np.ndarray, steps: int) -> float:
    """p of an error C h^p, from steps of 1 / steps and half of it."""
    coarse, fine = (float(np.linalg.norm(ends(1 / n) - exact)) for n in (steps, 2 * steps))
    return math.log2(coarse / fine)


def curved_forces(**stiff: bool) -> list[Any]:
    """Forces that follow curves over time and depend on the position."""
    return [
        motes.force.Gravity(g=keys((-1.0, [0.0, 0.0, -4.0]), (2.0, [1.0, 0.0, 3.0]))),
        motes.force.Attractor(
            strength=keys((-1.0, 3.0), (2.0, 8.0)),
            position=keys((-1.0, [1.0, 0.0, 0.0]), (2.0, [0.0, 1.5, 0.0])),
            softening=1.0,
            **stiff,
        ),
    ]


def flown(integrator: str, step: float, forces: list[Any], **scene: Any) -> np.ndarray:
    """Where a particle is after a second."""
    sim = one_particle(
        position=(0.3, 0.1, 0.0),
        velocity=(0.5, 0.2, 1.0),
        force=forces,
        integrator=integrator,
        step=step,
        **scene,
    )
    sim.run(until=1.0)
    return sim["ball"].position[0].copy()


@pytest.mark.parametrize("name", methods())
def test_every_method_has_its_order_in_a_scene(name: str) -> None:
    """|x_h - x| = C h^p, with forces that follow curves over time and depend on the position."""
    exact = flown("verner9", 1 / 64, curved_forces())
    measured = order_of(lambda h: flown(name, h, curved_forces()), exact, HALVED.get(name, 128))
    # Of the high orders, the next term of the error shows as well.
    order = method(name).order
    assert order - 0.25 < measured < order + (0.25 if order < 5 else 0.85)


IMPLICIT = [name for name, table in methods().items() if table.implicit]


@pytest.mark.parametrize("name", IMPLICIT)
def test_flows_and_drag_leave_implicit_methods_their_order(name: str) -> None:
    """x' = v + u(x, t), v' = a(x, t) - k (v - w): six equations that are solved together."""
    forces = [*curved_forces(), motes.force.Drag(rate=keys((-1.0, 2.0), (2.0, 5.0)))]
    flow = [motes.flow.Rotation(rate=keys((-1.0, 2.0), (2.0, 5.0)))]
    exact = flown("verner9", 1 / 64, forces, flow=flow)
    measured = order_of(lambda h: flown(name, h, forces, flow=flow), exact, 128)
    assert measured == pytest.approx(method(name).order, abs=0.25)


@pytest.mark.parametrize("name", ["backward_euler", "bdf2", "kencarp4", "radau5", "rodas4"])
def test_implicit_methods_carry_particles_without_forces(name: str) -> None:
    """x' = u(x, t) alone."""
    flow = [motes.flow.Rotation(rate=keys((-1.0, 2.0), (2.0, 5.0)))]
    exact = flown("verner9", 1 / 64, [], flow=flow)
    measured = order_of(lambda h: flown(name, h, [], flow=flow), exact, 64)
    assert measured == pytest.approx(method(name).order, abs=0.25)


@pytest.mark.parametrize("stiff", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("name", ["kencarp3", "kencarp4"])
def test_a_split_method_has_its_order_whichever_forces_are_stiff(
    name: str, stiff: tuple[bool, bool]
) -> None:
    """Those that are declared stiff go to the implicit table, the others to the explicit one."""
    drag = motes.force.Drag(rate=keys((-1.0, 2.0), (2.0, 5.0)), stiff=stiff[0])
    forces = [*curved_forces(stiff=stiff[1]), drag]
    plain = [*curved_forces(), motes.force.Drag(rate=keys((-1.0, 2.0), (2.0, 5.0)))]
    exact = flown("verner9", 1 / 64, plain)
    measured = order_of(lambda h: flown(name, h, forces), exact, 128)
    assert measured == pytest.approx(method(name).order, abs=0.25)
    if not all(stiff):
        assert flown(name, 0.1, forces) != pytest.approx(flown(name, 0.1, plain), rel=1e-9)


@pytest.mark.parametrize("name", ["kencarp3", "kencarp4"])
def test_a_stiff_force_of_a_split_method_bounds_no_step(name: str) -> None:
    """Drag k = 1e6 / s at h = 0.1: the terminal velocity g / k; taken explicitly it explodes."""
    drag = motes.force.Drag(rate=1e6, stiff=True)
    sim = one_particle(
        velocity=(3.0, 0.0, 0.0), force=[motes.force.Gravity(), drag], integrator=name, step=0.1
    )
    sim.run(steps=60)
    assert sim["ball"].velocity[0] == pytest.approx([0.0, 0.0, -9.81e-6], abs=2e-9)
    wrong = [motes.force.Gravity(stiff=True), motes.force.Drag(rate=1e6)]
    sim = one_particle(velocity=(3.0, 0.0, 0.0), force=wrong, integrator=name, step=0.1)
    sim.run(steps=10, checked=False)
    assert not abs(sim["ball"].velocity[0, 0]) < 1e20


def damps(table: Any) -> bool:
    """Whether a method is A-stable and damps infinitely stiff decay at once."""
    name = next(n for n, other in methods().items() if other is table)
    return table.implicit and name not in ("implicit_midpoint", "trapezoid")


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize("name", IMPLICIT)
def test_stiff_springs_and_drags_never_grow_in_a_scene(name: str, precision: str) -> None:
    """x'' = g - k (x - p) - c v at h = 1e6 / c and beyond; L-stable methods settle at once."""
    stiff = [motes.force.Drag(rate=1e7), motes.force.Attractor(strength=-1.0, softening=1.0)]
    sim = one_particle(
        velocity=(3.0, -2.0, 1.0), force=stiff, integrator=name, step=0.1, precision=precision
    )
    speeds = []
    for _ in range(4):
        sim.step()
        speeds.append(float(np.abs(sim["ball"].velocity[0]).max()))
    assert max(speeds) <= 3.0 * (1 + 1e-5)
    if damps(method(name)):
        assert speeds[-1] < 1e-4


def test_every_method_is_for_scenes_or_says_why_not() -> None:
    """All 28 run in a scene; what they do not go with is said in one line."""
    names = list(methods())
    assert len(names) == 28
    ball = motes.System("ball", emit=[motes.emit.Point(burst=[{"count": 1}])])
    rotation = [motes.flow.Rotation(rate=1.0)]
    fast = {"over": "speed", "keys": [[0, 1], [1, 2]]}
    faults = [
        ("nystrom5", {"force": [motes.force.Drag()]}, "drag depends on the velocity. Choose rk4"),
        ("nystrom5", {"flow": rotation}, "rotation depends on the velocity"),
        ("nystrom5", {"force": [motes.force.Level()]}, "level depends on the velocity"),
        (
            "nystrom5",
            {"force": [motes.force.Attractor(strength=fast)]},
            "attractor.strength depends on the velocity",
        ),
        ("kencarp4", {"force": [motes.force.Drag(stiff=True), motes.force.Agility()]}, "a limit"),
    ]
    faults += [
        (name, {"flow": rotation}, f"of order {method(name).order} is for forces alone: with the")
        for name in ("mclachlan4", "yoshida4", "yoshida6", "yoshida8")
    ]
    for name, parts, said in faults:
        with pytest.raises(SceneError, match=said) as caught:
            motes.Simulation(motes.Scene(systems=[ball], integrator=name, **parts)).step()
        assert "\n" not in str(caught.value)


def test_a_formula_that_remembers_starts_afresh_at_births_and_impacts() -> None:
    """bdf2 through births within steps and an impact: order 2, and the same with frames between."""
    floor = motes.solid.Plane(position=(0.0, 0.0, -1.0), restitution=1.0, friction=0.0)

    def end(step: float, name: str = "bdf2", glimpses: bool = False) -> np.ndarray:
        emitter = motes.emit.Point(
            burst=[{"at": 0.01234, "count": 1}, {"at": 0.35, "count": 1}],
            position=(0.0, 0.0, 0.0),
            velocity=(1.0, 0.0, 0.0),
        )
        forces = [motes.force.Gravity(), motes.force.Attractor(strength=2.0, softening=1.0)]
        sim = motes.Simulation(
            motes.Scene(
                systems=[motes.System("ball", emit=[emitter])],
                force=forces,
                solid=[floor],
                integrator=name,
                step=step,
                precision="double",
            )
        )
        for _ in range(round(1.0 / step)):
            sim.step()
            if glimpses:
                sim.frame(sim.time + 0.37 * step)
        assert sim.impacts > 0
        return sim["ball"].position.copy()

    exact = end(1 / 512, "verner9")
    coarse, fine = (np.abs(end(1 / n) - exact).max() for n in (64, 128))
    assert math.log2(coarse / fine) == pytest.approx(2, abs=0.2)
    assert (end(1 / 64, glimpses=True) == end(1 / 64)).all()


def test_a_past_moves_with_its_particle() -> None:
    """Where every second particle dies, the others fly on as if those had never been."""

    def end(mortal: bool) -> np.ndarray:
        emitter = motes.emit.Point(
            burst=[{"count": 40}], velocity={"mean": [1, 1, 1], "spread": [1, 1, 1]}
        )
        life = {"mean": 0.5, "spread": 0.4} if mortal else 5.0
        system = motes.System("ball", emit=[emitter], life=life)
        force = [motes.force.Attractor(strength=3.0, softening=1.0)]
        scene = motes.Scene(systems=[system], force=force, integrator="bdf2", step=0.02)
        sim = motes.Simulation(scene)
        sim.run(steps=30)
        order = np.argsort(sim["ball"].id)
        return sim["ball"].id[order], sim["ball"].position[order]

    ids, alone = end(True)
    everybody, together = end(False)
    assert 0 < len(ids) < len(everybody)
    assert (alone == together[np.isin(everybody, ids)]).all()


def test_a_frame_between_steps_is_as_good_as_a_step() -> None:
    """A glimpse at t + h / 3 by bdf2, whose steps differ then: second order as well."""

    def end(step: float) -> np.ndarray:
        sim = one_particle(
            velocity=(0.5, 0.2, 1.0), force=curved_forces(), integrator="bdf2", step=step
        )
        sim.run(steps=round(0.5 / step))
        return np.array(sim.frame(0.5 + step / 3).systems["ball"]["position"][0], float)

    def exact(step: float) -> np.ndarray:
        sim = one_particle(
            velocity=(0.5, 0.2, 1.0), force=curved_forces(), integrator="verner9", step=1 / 64
        )
        sim.run(steps=32)
        return np.array(sim.frame(0.5 + step / 3).systems["ball"]["position"][0], float)

    coarse, fine = (np.linalg.norm(end(1 / n) - exact(1 / n)) for n in (64, 128))
    assert math.log2(coarse / fine) == pytest.approx(2, abs=0.3)


def test_the_catalog_offers_every_force_the_mark() -> None:
    """`stiff` is a parameter of every force."""
    assert all("stiff" in part.parameters for part in catalog("force").values())
