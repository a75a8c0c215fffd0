"""Laws of what near particles do to one another in scenes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import component, quantity
from motes.group.nearby import Nearby
from motes.kernel import kernel


@component(kind="interact", name="test_cushion")
class Cushion:
    """A soft pair law: U = stiffness (radius - r)^2 / 2."""

    stiffness = quantity(40.0, "N/m", scope="scene")
    """Stiffness."""

    radius = quantity(0.5, "m", above=0, scope="scene")
    """Support radius."""

    def reach(p: Any) -> Any:
        return p.radius

    @kernel
    def force(p: Any, a: Any, b: Any, r: Any) -> Any:
        f = p.stiffness * (p.radius - r.length) / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p: Any, a: Any, b: Any, r: Any) -> Any:
        return 0.5 * p.stiffness * (p.radius - r.length) ** 2


def gas(law: Any = None, count: int = 3000, **settings: Any) -> motes.Simulation:
    """Particles in a periodic box, with random velocities."""
    at = {"size": (4.0, 4.0, 4.0), "position": (2.0, 2.0, 2.0), "speed": 1.0, "angle": 180.0}
    systems = [
        motes.System("a", emit=[motes.emit.Box(burst=[{"count": count}], **at)], mass=2.0),
        motes.System("b", emit=[motes.emit.Box(burst=[{"count": count // 3}], **at)]),
    ]
    chosen = {"step": 5e-3, "integrator": "leapfrog", "precision": "double", **settings}
    chosen.setdefault("periodic", {"size": (4.0, 4.0, 4.0)})
    return motes.Simulation(motes.Scene(systems=systems, interact=[law or Cushion()], **chosen))


def sorted_state(sim: motes.Simulation) -> np.ndarray:
    """Positions and velocities of all particles in the order of their ids."""
    found = []
    for name in ("a", "b"):
        view = sim[name]
        found.append(np.hstack([view.position, view.velocity])[np.argsort(view.id)])
    return np.concatenate(found)


def test_pair_laws_keep_momentum_and_energy() -> None:
    """sum m v is constant to rounding, energy to the square of the leapfrog's step."""
    drifts = []
    for step in (4e-3, 2e-3):
        sim = gas(step=step)
        sim.run(steps=1)
        before = sim.measure()
        sim.run(until=0.4)
        after = sim.measure()
        scale = 4000 * 2.0
        assert np.abs(after.momentum - before.momentum).max() < 1e-13 * scale
        drifts.append(abs(after.energy - before.energy) / before.energy)
    assert drifts[0] < 2e-3
    assert drifts[1] < 0.5 * drifts[0]


@pytest.mark.parametrize("integrator", ["leapfrog", "rk4"])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_bits_depend_neither_on_threads_nor_on_frames(integrator: str, precision: str) -> None:
    """A frame is a throwaway partial step, and may build lists that the run never sees."""
    digests = set()
    before = motes.threads()
    try:
        for threads, frames in ((1, False), (2, False), (3, True)):
            motes.threads(threads)
            sim = gas(integrator=integrator, precision=precision, step=2e-2)
            for k in range(9):
                sim.run(steps=1)
                if frames and k % 3:
                    sim.frame((sim.steps + 0.3 + 2.2 * (k % 2)) * 2e-2)
            digests.add(sim.digest())
    finally:
        motes.threads(before)
    assert len(digests) == 1


def test_order_of_rows_changes_nothing_but_rounding() -> None:
    ends = []
    for permuted in (False, True):
        sim = gas()
        sim.run(steps=1)
        if permuted:
            memory = sim._state.memories[0]
            memory.__init__()
            for rows in sim._state.systems.values():
                rows.reorder(np.random.default_rng(5).permutation(rows.count).astype(np.int32))
        sim.run(steps=20)
        ends.append(sorted_state(sim))
    assert np.abs(ends[0] - ends[1]).max() < 1e-12
    assert (ends[0] != ends[1]).any()


def test_the_skin_changes_nothing_but_rounding() -> None:
    """Lists that last for one evaluation, and such that last for many."""
    ends = []
    for skin in (0.0, 0.05, 0.5):
        sim = gas(Cushion(skin=skin))
        sim.run(steps=40)
        ends.append(sorted_state(sim))
        builds = sim._state.memories[0].builds
        assert (builds > 40) == (skin == 0.0)
        assert (builds < 10) == (skin == 0.5)
    assert np.abs(ends[0] - ends[1]).max() < 1e-12
    assert np.abs(ends[0] - ends[2]).max() < 1e-12


@pytest.mark.parametrize("share", [0.36, 1.0])
@pytest.mark.parametrize("also", [0.0, 1.7])
def test_lists_are_renewed_before_two_that_approach_can_meet(share: float, also: float) -> None:
    """Two are just outside of what was listed, and come from both sides straight at each other.

    They feel each other in the very step in which they do with lists of that step alone. `share`
    of the skin is the margin of one and of the other kind of lists; `also` moves both sideways.
    """
    ends = []
    for skin in (0.0, 0.4):
        law = Cushion(skin=skin, stiffness=4e3)
        scene = motes.Scene(
            systems=[motes.System("a")], interact=[law], step=4e-3, precision="double",
            integrator="leapfrog",
        )  # fmt: skip
        sim = motes.Simulation(scene)
        half = 0.5 * 0.5 * (1 + 0.4 * share) * (1 + 1e-9)
        sim.place("a", [[-half, 0, 0], [half, 0, 0]], [[0.09, also, 0], [-0.09, also, 0]])
        sim.run(steps=400)
        ends.append(sim["a"].position[np.argsort(sim["a"].id)])
        assert sim["a"].velocity[np.argmax(sim["a"].position[:, 0]), 0] > 0.08
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-12)


def test_two_laws_add_up_and_share_lists() -> None:
    """Two cushions of half the stiffness are one; a third of another reach has lists of its own."""
    halves = [Cushion(name="one", stiffness=20.0), Cushion(name="two", stiffness=20.0)]
    small = Cushion(name="small", radius=0.2)
    one, two = gas(), gas()
    both = motes.Simulation(two.scene.model_copy(update={"interact": tuple(halves)}))
    one.run(steps=20)
    both.run(steps=20)
    assert np.abs(sorted_state(one) - sorted_state(both)).max() < 1e-12
    assert len(both._groups[0].nearby.classes) == 1
    mixed = motes.Simulation(two.scene.model_copy(update={"interact": (*halves, small)}))
    assert len(mixed._groups[0].nearby.classes) == 2
    mixed.run(steps=20)
    assert np.abs(sorted_state(one) - sorted_state(mixed)).max() > 1e-4


def test_leapfrog_sums_forces_once_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last kick of a step and the first of the next are the same sum."""
    sim, calls = gas(count=300), []
    sim.run(steps=1)
    push = Nearby.push
    monkeypatch.setattr(Nearby, "push", lambda *a: calls.append(1) or push(*a))
    for _ in range(10):
        sim.run(steps=1)
    assert len(calls) == 10


def test_who_leaves_a_periodic_box_comes_in_on_the_other_side() -> None:
    sim = gas(
        Cushion(stiffness=0.0), count=300, step=2e-2, periodic={"low": (0, 0, 0), "size": (4, 0, 4)}
    )
    sim.run(steps=100)
    x = np.concatenate([sim["a"].position, sim["b"].position])
    assert x[:, [0, 2]].min() >= 0
    assert x[:, [0, 2]].max() < 4
    assert x[:, 1].max() > 4.5


def test_rows_come_in_the_order_of_cells() -> None:
    """Neighbours are near in memory: most rows are within the reach of the next."""
    sim = gas(periodic={})
    sim.run(steps=1)
    x = sim["a"].position
    assert np.median(np.linalg.norm(np.diff(x, axis=0), axis=1)) < 0.5


def test_births_and_deaths_are_felt() -> None:
    """A jet of particles that die: nobody feels the dead, everybody the newborn."""
    emitter = motes.emit.Box(rate=4000.0, size=(0.6, 0.6, 0.6))
    systems = [motes.System(n, life={"mean": 0.15, "spread": 0.1}, emit=[emitter]) for n in "ab"]
    sims = []
    for skin in (0.0, 0.3):
        scene = motes.Scene(
            systems=systems, interact=[Cushion(skin=skin)], step=5e-3, precision="double",
            integrator="leapfrog",
        )  # fmt: skip
        sim = motes.Simulation(scene)
        sim.run(steps=60)
        sims.append(sorted_state(sim))
    assert np.abs(sims[0] - sims[1]).max() < 1e-9
    assert np.abs(sims[0][:, 3:]).max() > 0.1


def test_a_reach_may_change_over_time() -> None:
    """A reach that grows beyond what is listed makes new lists."""
    law = Cushion(radius={"over": "time", "keys": [[0.0, 0.2], [0.1, 0.6]]}, skin=0.02)
    exact = Cushion(radius={"over": "time", "keys": [[0.0, 0.2], [0.1, 0.6]]}, skin=0.0)
    ends = []
    for one in (law, exact):
        sim = gas(one, count=900)
        sim.run(steps=20)
        ends.append(sorted_state(sim))
    assert np.abs(ends[0] - ends[1]).max() < 1e-12


def test_faults_of_laws_are_said_in_one_line() -> None:
    with pytest.raises(motes.SceneError, match=r"reach 3 m is more than half of .* 2 m"):
        gas(Cushion(radius=3.0))
    with pytest.raises(motes.SceneError, match=r'no system "c"\. There are: a, b'):
        gas(Cushion(sources=["c"]))
    with pytest.raises(motes.SceneError, match="above 0"):
        Cushion(radius=0.0)
    with pytest.raises(motes.SceneError, match="size"):
        motes.Periodic(size=(-1, 0, 0))
