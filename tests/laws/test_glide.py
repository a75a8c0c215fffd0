"""Several steps of a group in one pass: the same bits as step by step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import motes
from motes.group import glide
from motes.group.lasting import CAUTION, SHORT
from motes.group.renewal import bounds_in, judge
from motes.jit import jit
from motes.repeat import Relay, Repeat


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """Whatever a test sets."""
    before = motes.threads()
    yield
    motes.threads(before)


def gas(count: int = 2000, **changed: Any) -> motes.Simulation:
    """A fluid of two species with laws of two lengths, in a periodic box."""
    rng = np.random.default_rng(3)
    size = (count / 0.6) ** (1 / 3)
    near = motes.interact.LennardJones(name="near", cutoff=2.5, systems=["a", "b"])
    far = motes.interact.Yukawa(name="far", cutoff=min(5.5, size / 2.1), systems=["a"])
    one = motes.System(name="a", mass=1.0)
    given = {"interact": (near, far), "step": 0.004, "integrator": "leapfrog"} | changed
    scene = motes.Scene(
        duration=1.0, systems=(one, one.model_copy(update={"name": "b"})),
        periodic=motes.Periodic(size=(size,) * 3), **given,
    )  # fmt: skip
    sim = motes.Simulation(scene)
    side = int(np.ceil(count ** (1 / 3)))
    places = np.indices((side,) * 3).reshape(3, -1).T[:count] * size / side
    for name, part in (("a", places[::2]), ("b", places[1::2])):
        sim.place(name, part, 1.2 * rng.normal(size=part.shape))
    return sim


@pytest.fixture
def glided(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many steps every pass took."""
    taken: list[int] = []
    call = glide.Glide.__call__
    monkeypatch.setattr(glide.Glide, "__call__", lambda *a: taken.append(call(*a)) or taken[-1])
    return taken


CASES: list[dict[str, Any]] = [
    {}, {"precision": "double"}, {"integrator": "yoshida4", "precision": "double"},
    {"integrator": "semi_implicit_euler"},
]  # fmt: skip


@pytest.mark.parametrize("changed", CASES, ids=str)
def test_steps_at_once_are_steps_one_by_one(changed: dict[str, Any], glided: list[int]) -> None:
    """Lists are chosen and built anew at the same steps, and every bit is the same."""
    one_by_one = gas(**changed)
    for _ in range(90):
        one_by_one.run(steps=1)
    assert not glided
    builds = one_by_one._state.memories[0].builds
    assert builds > 3
    for threads in (1, 2, 3):
        motes.threads(threads)
        sim = gas(**changed)
        sim.run(steps=90)
        assert sim.digest() == one_by_one.digest()
        assert sim._state.memories[0].builds == builds
        assert sum(glided) > 60
        glided.clear()


def test_frames_between_change_nothing(glided: list[int]) -> None:
    """A frame is a copy that goes on by itself; what it shares with the run is not written to."""
    plain, looked_at = gas(), gas()
    plain.run(steps=60)
    for _ in range(6):
        looked_at.run(steps=10)
        looked_at.frame(looked_at.time + 0.5 * looked_at.scene.step)
    assert looked_at.digest() == plain.digest()
    assert sum(glided) > 60


def test_births_interrupt_a_pass(glided: list[int]) -> None:
    """Steps in which somebody is born are taken one by one."""
    burst = motes.emit.Point(burst=[{"at": 0.1, "count": 1}], position=(0.3, 0.2, 0.1))
    runs = []
    soft = motes.interact.SoftSphere(diameter=1.0)
    for together in (40, 1):
        sim = gas(interact=(soft,))
        scene = sim.scene.model_copy(
            update={"systems": (sim.scene.systems[0].model_copy(update={"emit": (burst,)}),
                                sim.scene.systems[1])}
        )  # fmt: skip
        again = motes.Simulation(scene)
        for name in ("a", "b"):
            again.place(name, sim[name].position, sim[name].velocity)
        for _ in range(40 // together):
            again.run(steps=together)
        runs.append(again)
    assert runs[0].count == 2001
    assert runs[0].digest() == runs[1].digest()
    assert glided
    assert max(glided) < 40


@jit
def add(total: Any, amount: Any, place: Any) -> None:
    total[place] += amount


@jit
def halt(stop: Any, total: Any, limit: Any, number: Any) -> None:
    if total[0] > limit and total[39] > limit:
        stop[0] = number


@jit
def double_all(total: Any, begin: Any, end: Any) -> None:
    for i in range(begin, end):
        total[i] *= 2


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_a_relay_goes_phase_by_phase(threads: int) -> None:
    """Phases in turn, numbers by round, and nothing after the phase in which one stops it."""
    motes.threads(threads)
    total, stop = np.zeros(40), np.zeros(1, np.int64)
    relay = Relay(6, stop, 5)
    amounts, rounds = np.arange(1.0, 7.0), np.arange(1, 7)
    relay.add(Repeat(add, (total,), [(k,) for k in range(40)]), amounts[:, None])
    relay.add(Repeat(halt, (stop, total, 25.0), [()]), rounds[:, None])
    relay.add(Repeat(double_all, (total,), [(k, k + 4) for k in range(0, 40, 4)]))
    assert relay.possible
    relay.run()
    expected = 0.0
    for amount in amounts.tolist():
        expected += amount
        if expected > 25:
            break
        expected *= 2
    assert stop[0] == 4
    assert total.tolist() == [expected] * 40


def test_lists_are_judged_as_ever() -> None:
    """The kernel decides as `Class.good` and `Class.short_radius` do, for all ways and for none."""
    sim = gas(100)
    shared = sim._groups[0].nearby.classes[0]
    sim.run(steps=2)
    found = sim._state.memories[0].lists[0]
    assert found is not None
    reach, bounds, stop = shared.reach(0.0), bounds_in({}), np.zeros(1, np.int64)
    widest, edge = found.radius - reach, shared.margin(found, 0.0) / 2
    last = (found.radius - (reach + SHORT * widest / 2) / CAUTION) / 2
    ways = np.linspace(0, widest, 40), last * (1 - 1e-5), last * (1 + 1e-5), np.inf, np.nan
    sinces = np.linspace(0, widest / 2, 40), edge * (1 - 1e-5), edge * (1 + 1e-5), np.nan
    for moved in np.hstack(ways):
        for since in np.hstack(sinces):
            bounds[:] = 0, 0, reach, found.radius, shared.margin(found, 0.0), 0, 1
            stop[0] = 0
            judge(stop, bounds, np.array([[0.0, 0.0], [moved**2, since**2]]), 5)
            good = shared.good(found, np.sqrt(since**2), 0.0, 0) and np.isfinite(moved)
            way = moved if np.isfinite(since) else np.nan
            radius = 0.0 if good else shared.short_radius(found, np.sqrt(way**2), 0.0)
            assert bounds[1] == (radius > 0)
            assert bounds[0] == radius
            assert stop[0] == (0 if good or radius else 5)
