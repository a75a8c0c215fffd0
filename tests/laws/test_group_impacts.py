"""Laws of systems that feel each other and meet solids."""

from __future__ import annotations

import numpy as np

import motes
from motes.catalog import component, quantity
from motes.kernel import kernel, sin


@component(kind="emit", name="test_lattice")
class Lattice:
    """The k-th atom at the k-th place of a cubic lattice, with a velocity that looks random."""

    spacing = quantity(1.3, "m", scope="scene")
    """Distance of neighbours."""

    @kernel
    def birth(p, u, t, k):
        i, j, l = k % 3, (k // 3) % 3, k // 9
        a = 3.0 * i + 5.0 * j + 7.0 * l
        x, y, z = p.spacing * (i - 1), p.spacing * (j - 1), p.spacing * (l - 1)
        return x, y, z, 2.0 * sin(a), 2.0 * sin(a + 1.0), 2.0 * sin(a + 2.0)


def gas(step: float, restitution: float = 1.0, **changes: object) -> motes.Simulation:
    """27 atoms between six walls."""
    side = 5.0
    walls = [
        motes.solid.Plane(
            name=f"wall-{axis}-{'low' if sign < 0 else 'high'}",
            position=[sign * side / 2 if k == axis else 0.0 for k in range(3)],
            rotation=_turned(axis, sign),
            restitution=restitution,
            friction=0.0,
        )
        for axis in range(3)
        for sign in (-1, 1)
    ]
    settings = {"precision": "double", "integrator": "leapfrog", "step": step, **changes}
    return motes.Simulation(
        motes.Scene(
            systems=[motes.System("gas", emit=[Lattice(burst=[{"count": 27}])])],
            interact=[motes.interact.LennardJones(cutoff=2.2)],
            solid=walls,
            **settings,
        )
    )


def _turned(axis: int, sign: int) -> list[float]:
    """Angles that turn a plane's normal +z to the inner side of a wall."""
    if axis == 2:
        return [0.0 if sign < 0 else 180.0, 0.0, 0.0]
    if axis == 1:
        return [-90.0 if sign < 0 else 90.0, 0.0, 0.0]
    return [0.0, 90.0 if sign < 0 else -90.0, 0.0]


def test_elastic_walls_keep_a_gas_in_and_its_energy() -> None:
    """E is constant; the leapfrog's error stays bounded and falls with the step's square."""
    worst = []
    for step in (0.002, 0.001):
        sim = gas(step)
        sim.run(steps=1)
        start = sim.measure().energy
        errors = []
        while sim.time < 1.0 - step / 2:
            sim.run(steps=10)
            errors.append(abs(sim.measure().energy - start))
        assert np.all(np.abs(sim["gas"].position) <= 2.5 + 1e-9)
        assert sim.impacts > 50
        kinetic = 0.5 * np.sum(np.array(sim["gas"].velocity) ** 2)
        worst.append(max(errors) / kinetic)
    print(worst)
    assert worst[1] < 2e-3
