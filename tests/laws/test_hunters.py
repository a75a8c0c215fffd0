"""Laws of predators and prey, leaders, and several species."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import motes


def hunt(**capture: Any) -> motes.Simulation:
    """A hawk that flies along a row of ten mice."""
    mice = motes.System(
        "mice", emit=[motes.emit.Point(name=f"m{k}", burst=[{"count": 1}], position=(k, 0, 0))
                      for k in range(10)],
        force=[motes.force.Cruise(speed=0.0)],
    )  # fmt: skip
    hawk = motes.System(
        "hawk",
        emit=[motes.emit.Point(burst=[{"count": 1}], position=(-1, 0.2, 0), velocity=(1, 0, 0))],
        force=[motes.force.Cruise(speed=1.0)],
    )
    law = motes.interact.Capture(hunters=["hawk"], radius=0.25, **capture)
    return motes.Simulation(motes.Scene(
        systems=[mice, hawk], interact=[law], step=0.05, integrator="semi_implicit_euler",
        precision="double",
    ))  # fmt: skip


def test_captures_are_deaths_and_are_told() -> None:
    """Each mouse dies once the hawk is within the radius: 0.15 m before it is beside it."""
    sim = hunt()
    sim.run(until=5.5)
    assert len(sim["mice"]) == 5
    assert len(sim["hawk"]) == 1
    told = sim.captures
    assert told["time"] == pytest.approx(np.arange(5) + 0.85, abs=0.0501)
    assert (told["hunter"] == sim["hawk"].id[0]).all()
    assert told["place"][:, 0] == pytest.approx(np.arange(5))
    assert not set(told["prey"]) & set(sim["mice"].id)
    before = len(sim.captures)
    sim.frame(8.0)
    assert len(sim.captures) == before  # A look ahead catches nobody.


def test_the_radius_of_captures() -> None:
    """Who is 0.2499 m away is caught, who is 0.2501 m away is not; of two near the nearer one."""
    places = {"in": 0.2499, "out": 10.2501, "near": 20.1, "next": 20.2}
    mice = [motes.emit.Point(name=n, burst=[{"count": 1}], position=(x, 0, 0))
            for n, x in places.items()]  # fmt: skip
    cats = [motes.emit.Point(name=f"c{k}", burst=[{"count": 1}], position=(10 * k, 0, 0))
            for k in range(3)]  # fmt: skip
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("mice", emit=mice), motes.System("cats", emit=cats)],
        interact=[motes.interact.Capture(hunters=["cats"], radius=0.25)], precision="double",
    ))  # fmt: skip
    sim.run(steps=1)
    assert np.sort(sim.captures["place"][:, 0]) == pytest.approx([0.2499, 20.1])


def test_the_rate_of_captures() -> None:
    """A hundred and twenty mice near a cat that waits: in 0.3 s one is caught with the chance
    1 - exp(-0.3 rate) a step-free law gives; the cat takes the nearest first, one a step."""
    alone = [
        motes.emit.Point(name=f"{who}{k}", burst=[{"count": 1}], position=(10 * k, 0.1 * far, 0))
        for who, far in (("cat", 0), ("mouse", 1))
        for k in range(120)
    ]
    still = [motes.force.Cruise(speed=0.0)]
    law = motes.interact.Capture(hunters=["cats"], radius=0.25, rate=2.0)
    sim = motes.Simulation(motes.Scene(
        systems=[motes.System("cats", emit=alone[:120], force=still),
                 motes.System("mice", emit=alone[120:], force=still)],
        interact=[law], step=0.05, integrator="semi_implicit_euler", seed=1,
    ))  # fmt: skip
    for end in (0.3, 1.0):
        sim.run(until=end)
        share = 1 - np.exp(-2.0 * end)
        assert abs(len(sim.captures) / 120 - share) < 3 * np.sqrt(share * (1 - share) / 120)


def test_the_chance_of_a_capture() -> None:
    """Luck below 1 - exp(-rate h) is a capture, luck above is none; many are found as few are."""
    law = SimpleNamespace(radius=0.3, rate=4.0)
    chance = 1 - np.exp(-4.0 * 0.05)
    for count in (3, 200):
        x = np.arange(3.0 * count).reshape(count, 3).T
        cats = SimpleNamespace(name="cats", position=x, ids=np.arange(count))
        mice = SimpleNamespace(name="mice", position=x + 0.1, ids=np.arange(count))
        for luck, caught in ((chance - 1e-9, count), (chance + 1e-9, 0)):
            drawn = lambda i, j, luck=luck: np.full(len(i), luck)  # noqa: E731
            ((_, i, _, j),) = motes.interact.Capture.kernel("captures")(
                law, [cats], [mice], drawn, 0.05
            )
            assert len(i) == len(j) == caught
            assert (i == j).all()


def test_followers_come_up_behind_their_leader() -> None:
    """A place `behind` on the leader's way, at his velocity."""
    leader = motes.System(
        "leader", emit=[motes.emit.Point(burst=[{"count": 1}], velocity=(2, 1, 0))],
        force=[motes.force.Cruise(speed=5**0.5)],
    )  # fmt: skip
    dog = motes.System(
        "dog", emit=[motes.emit.Point(burst=[{"count": 1}], position=(0, 5, 1))],
        force=[motes.force.Wander(strength=0.0)],
    )  # fmt: skip
    law = motes.interact.FollowLeader(systems=["dog"], sources=["leader"], behind=2.0, response=0.5)
    sim = motes.Simulation(motes.Scene(
        systems=[leader, dog], interact=[law], precision="double", integrator="rk4"
    ))  # fmt: skip
    sim.run(until=12.0)
    way = sim["leader"].position[0] - sim["dog"].position[0]
    assert way == pytest.approx(2 * np.array([2, 1, 0]) / 5**0.5, abs=1e-6)


def test_hunters_close_in_and_prey_flees() -> None:
    """Pursuit turns to the prey's future place; evasion leads away from the hunter."""
    hawk = motes.System(
        "hawk", emit=[motes.emit.Point(burst=[{"count": 1}], velocity=(1, 0, 0))],
    )  # fmt: skip
    dove = motes.System(
        "dove",
        emit=[motes.emit.Point(burst=[{"count": 1}], position=(4, 0, 0), velocity=(0, 1, 0))],
    )
    laws = [
        motes.interact.Pursue(systems=["hawk"], sources=["dove"], strength=2.0, foresight=1.0),
        motes.interact.Evade(systems=["dove"], sources=["hawk"], strength=3.0, foresight=0.0,
                             radius=8.0),
    ]  # fmt: skip
    sim = motes.Simulation(motes.Scene(
        systems=[hawk, dove], interact=laws, precision="double", step=0.01,
        integrator="semi_implicit_euler",
    ))  # fmt: skip
    sim.run(steps=1)
    aim = np.array([4, 0, 0]) + (np.array([0, 1, 0]) - np.array([1, 0, 0])) * 1.0
    kick = (sim["hawk"].velocity[0] - (1, 0, 0)) / 0.01
    assert kick == pytest.approx(2.0 * aim / np.linalg.norm(aim), abs=1e-9)
    assert (sim["dove"].velocity[0] - (0, 1, 0)) / 0.01 == pytest.approx([3 * 0.5, 0, 0], abs=1e-9)


def species(n: int, **settings: Any) -> motes.Simulation:
    """Two species that keep apart from all, fly with their own kind, and one flees the other."""
    systems = [
        motes.System(name, emit=[motes.emit.Box(
            burst=[{"count": n}], size=(5, 5, 5), velocity={"low": [-1] * 3, "high": [2, 1, 1]}
        )]) for name in ("doves", "geese")
    ]  # fmt: skip
    laws = [
        motes.interact.Separation(radius=1.0, strength=3.0),
        *(motes.interact.Alignment(name=f"a{name}", systems=[name], radius=1.5, rate=1.0)
          for name in ("doves", "geese")),
        motes.interact.Evade(systems=["doves"], sources=["geese"], radius=1.2, strength=2.0),
    ]  # fmt: skip
    known = {"precision": "double", "integrator": "semi_implicit_euler", "step": 0.02, "seed": 4}
    return motes.Simulation(motes.Scene(systems=systems, interact=laws, **{**known, **settings}))


def test_several_species_feel_each_other() -> None:
    """A law of two sources sums over both; one among a kind does not see the other kind."""
    sim = species(120)
    names = ("doves", "geese")
    start = sim.scene.model_copy(update={"interact": ()})
    other = motes.Simulation(start)
    other.run(steps=1)
    sim.run(steps=1)
    v = np.concatenate([other[n].velocity[np.argsort(other[n].id)] for n in names])
    x = np.concatenate([other[n].position[np.argsort(other[n].id)] for n in names]) - 0.02 * v
    found = np.concatenate([sim[n].velocity[np.argsort(sim[n].id)] for n in names])
    r = x[:, None] - x
    d = np.sqrt((r**2).sum(axis=2)) + 10 * np.eye(240)
    kind = np.repeat([0, 1], 120)
    same = kind[:, None] == kind
    apart = np.where(d < 1.0, (1 - d) / d, 0)
    a = 3.0 * (apart[:, :, None] * r).sum(axis=1)
    ahead = -np.einsum("ik,ijk->ij", v, r)
    seen = ahead >= np.cos(np.radians(135)) * np.linalg.norm(v, axis=1)[:, None] * d
    w = np.where((d < 1.5) & same & seen, 1 - d / 1.5, 0)
    total = (w[:, :, None] * (v[None] - v[:, None])).sum(axis=1)
    a += total / (w.sum(axis=1) + 0.05)[:, None]
    kick = (found - v) / 0.02
    geese = kind == 1
    assert kick[geese] == pytest.approx(a[geese], abs=1e-9)
    fled = kick[~geese] - a[~geese]
    near = (np.where(geese, d, 10)[~geese] < 0.7).any(axis=1)
    assert np.linalg.norm(fled[near], axis=1).min() > 0.1
    assert fled[(np.where(geese, d, 10)[~geese] > 2.5).all(axis=1)] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("scene", "together"),
    [
        ("murmuration", {"starlings", "hawk"}),
        ("fish_school", {"fish", "shark"}),
        ("battle", {"west", "east"}),
    ],
)
def test_hunters_and_prey_are_one_group(scene: str, together: set[str]) -> None:
    """They take every stage of a step together; arrows and dust go by themselves."""
    groups = motes.Simulation(motes.load(scene))._groups
    assert [set(group.steppers) for group in groups] == [together]
