"""One step: the same bits on any number of threads, the plain method, what folding may change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.plain.rk4 import rk4

import motes
import motes.compile.text
import motes.step


def jets(*, precision: str = "single", **options: Any) -> motes.Scene:
    """Some thousands of particles, with births, bounces and deaths."""
    system = motes.System(
        "jet",
        life={"mean": 0.3, "spread": 0.2},
        emit=[
            motes.emit.Cone(rate=400_000, speed={"mean": 3, "spread": 1}, angle=150),
            motes.emit.Sphere(burst=[{"at": 0.0, "count": 40_000}], position=(0, 0, 2)),
        ],
        force=[motes.force.Gravity(), motes.force.Drag(), motes.force.Vortex()],
    )
    return motes.Scene(
        systems=[system], solid=[motes.solid.Plane()], precision=precision, **options
    )


def test_the_result_does_not_depend_on_the_number_of_threads() -> None:
    """Equal digests with 1, 2 and 4 threads, and in one run or single steps."""
    before, digests = motes.threads(), set()
    try:
        for count in (1, 2, 4):
            motes.threads(count)
            simulation = motes.Simulation(jets(step=0.01))
            if count == 2:
                simulation.run(steps=12)
            else:
                for _ in range(12):
                    simulation.step()
            assert simulation.impacts > 100
            digests.add(simulation.digest())
    finally:
        motes.threads(before)
    assert len(digests) == 1


@pytest.mark.parametrize("life", [None, 0.37, {"mean": 0.4, "spread": 0.1}])
def test_steps_that_are_taken_together_are_those_taken_one_by_one(
    life: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same bits, with a burst on the way, a rate that begins later, deaths, two systems."""
    monkeypatch.setattr(motes.step, "GLIDING", 1 << 12)  # Less than a thread's rows.

    def dust(name: str, *emitters: Any, life: Any = None) -> motes.System:
        force = [motes.force.Gravity(), motes.force.Drag(), motes.force.Turbulence()]
        return motes.System(name, emit=list(emitters), force=force, life=life)

    early = motes.emit.Box(burst=[{"at": 0.0, "count": 30_000}, {"at": 0.233, "count": 1_000}])
    late = motes.emit.Cone(rate={"over": "time", "keys": [[0.4, 0.0], [0.45, 900.0]]})
    systems = [dust("a", early, life=life), dust("b", early, late)]
    scene = motes.Scene(systems=systems, step=0.01)
    together, one_by_one = motes.Simulation(scene), motes.Simulation(scene)
    together.run(steps=60)
    for _ in range(60):
        one_by_one.step()
    assert together.count > (62_005 if life is None else 31_005)
    assert together.work == one_by_one.work
    assert together.time == one_by_one.time
    assert together.digest() == one_by_one.digest()


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("bad", [np.inf, -np.inf, np.nan])
def test_the_first_particle_that_is_no_number_is_found(axis: int, bad: float) -> None:
    """In any column and any block of rows, and not where numbers are only very large."""
    rows = motes.Simulation(motes.Scene(systems=[motes.System("dust")]))._state.systems["dust"]
    large = np.full((3, 70_000), 0.9 * np.finfo(np.float32).max, np.float32)
    rows.append(large, large, 0.0, np.uint64(1))
    assert rows.first_not_finite() is None
    for row in (69_999, 65_536, 65_535, 7, 0):
        (rows.position if axis < 3 else rows.velocity)[axis % 3, row] = bad
        assert rows.first_not_finite() == row


def cloud(force: list[Any], precision: str) -> motes.Simulation:
    """A thousand particles that do not move yet, at rest in a box."""
    box = motes.emit.Box(burst=[{"at": 0.0, "count": 1000}], size=(2, 2, 2), position=(0.5, 0, 0))
    system = motes.System("cloud", emit=[box], force=force)
    scene = motes.Scene(systems=[system], precision=precision, step=0.05)
    simulation = motes.Simulation(scene)
    simulation.step()
    return simulation


WIND = np.array([1.0, 0.0, -2.0])
DRAGS = {
    "even": ([motes.force.Drag(rate=0.3)], lambda v: -0.3 * v),
    "windy": (
        [motes.force.Drag(rate=0.3), motes.force.Drag(name="air", rate=4.0, wind=tuple(WIND))],
        lambda v: -0.3 * v - 4.0 * (v - WIND),
    ),
    "uneven": (
        [motes.force.Drag(rate=0.3), motes.force.QuadraticDrag(k=0.5)],
        lambda v: -(0.3 + 0.5 * np.linalg.norm(v, axis=1, keepdims=True)) * v,
    ),
}
"""Forces, and what they make of velocities."""


@pytest.mark.parametrize("drag", DRAGS)
@pytest.mark.parametrize(("precision", "rounding"), [("single", 2.0**-24), ("double", 2.0**-53)])
def test_the_fused_step_is_the_plain_method(precision: str, rounding: float, drag: str) -> None:
    """Butcher's tableau, by whole arrays in double precision: equal but for rounding.

    A step adds some hundred rounded terms, which a core of 0.1 m magnifies by up to 1 / core.
    """
    drags, eased = DRAGS[drag]
    simulation = cloud([motes.force.Gravity(), *drags, motes.force.Vortex(strength=2.0)], precision)
    view = simulation["cloud"]
    x = np.array(view.position, float)
    v = np.array(view.velocity, float)

    def acceleration(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        a = eased(v)
        k = 2.0 / (x[:, 0] ** 2 + x[:, 1] ** 2 + 0.1**2)
        a += np.stack([-k * x[:, 1], k * x[:, 0], np.full_like(k, -9.81)], axis=1)
        return a

    expected = rk4(acceleration, x, v, 0.05)
    simulation.step()
    view = simulation["cloud"]
    for found, right in zip((view.position, view.velocity), expected, strict=True):
        assert np.abs(found - right).max() <= 1000 * rounding * max(1.0, np.abs(right).max())


@pytest.mark.parametrize(("precision", "rounding"), [("single", 2.0**-24), ("double", 2.0**-53)])
def test_folding_a_default_changes_nothing_but_rounding(
    monkeypatch: pytest.MonkeyPatch, precision: str, rounding: float
) -> None:
    """The same values as literals and as numbers read at run time."""

    def force() -> list[Any]:
        return [motes.force.Vortex(), motes.force.Drag(), motes.force.Wind(), motes.force.Gravity()]

    folded = cloud(force(), precision)
    monkeypatch.setattr(motes.compile.text, "_known", lambda component: {})
    plain = cloud(force(), precision)
    folded.run(steps=4)
    plain.run(steps=4)
    for name in ("position", "velocity"):
        a, b = getattr(folded["cloud"], name), getattr(plain["cloud"], name)
        assert np.abs(a - b).max() <= 4000 * rounding * max(1.0, np.abs(b).max())


def test_folding_follows_what_a_literal_implies() -> None:
    """A vertical vortex at the origin without pull and lift is a handful of operations."""
    from motes.force import Vortex
    from motes.kernel.language import Translation

    known = {
        key: tuple(float(v) for v in Vortex().values[key].values)
        for key in Vortex.own
        if key != "strength"
    }
    translation = Translation()
    translation.add(Vortex.kernel("acceleration"), "vortex", known)
    source = translation.text[-1]
    assert "q.z" not in source
    assert "sqrt" not in source
    assert source.count("p.") == source.count("p.strength")
    assert translation.returned["acceleration_0"] == (None, None, 0.0)
