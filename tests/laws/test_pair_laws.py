"""Every pair law against its formula, written down once more: energy, virial and acceleration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import catalog
from motes.interact import (
    Charge,
    InversePowers,
    LennardJones,
    Morse,
    NearSpring,
    SoftSphere,
    Yukawa,
)

Potential = Callable[[Any], Any]

FORMULAS: list[tuple[type[Any], dict[str, float], float, Potential]] = [
    (
        LennardJones, {"epsilon": 1.7, "sigma": 0.9}, 2.1,
        lambda r: 4 * 1.7 * ((0.9 / r) ** 12 - (0.9 / r) ** 6),
    ),
    (
        InversePowers, {"k1": 2.0, "m": 7.0, "k2": 1.5, "n": 3.0}, 2.1,
        lambda r: 2.0 / (6 * r**6) - 1.5 / (2 * r**2),
    ),
    (
        Morse, {"depth": 1.4, "length": 1.1, "width": 0.3}, 2.1,
        lambda r: 1.4 * ((1 - np.exp(-(r - 1.1) / 0.3)) ** 2 - 1),
    ),
    (Yukawa, {"strength": 1.9, "screening": 0.7}, 2.1, lambda r: 1.9 * np.exp(-r / 0.7) / r),
    (
        SoftSphere, {"stiffness": 30.0, "diameter": 2.1, "exponent": 2.5}, 2.1,
        lambda r: 30.0 * 2.1**2 * (1 - r / 2.1) ** 2.5 / 2.5,
    ),
    (
        Charge, {"k": 1.2, "charge": 0.8}, 2.1,
        lambda r: 1.2 * 0.64 * (1 / r - 2 / 2.1 + r / 2.1**2),
    ),
    (
        NearSpring, {"stiffness": 12.0, "length": 1.2, "breaking": 2.1}, 2.1,
        lambda r: 6.0 * ((r - 1.2) ** 2 - 0.9**2),
    ),
]  # fmt: skip
"""Law, parameters, reach R, and U(r) before it is cut off."""


def slope(potential: Potential, r: float) -> float:
    """dU/dr to rounding, by a step along the imaginary axis."""
    return float(np.imag(potential(r + 1e-30j)) / 1e-30)


def cases() -> list[Any]:
    """All laws with all ways to end at the reach."""
    found = []
    for law, values, reach, potential in FORMULAS:
        ways = ("plain", "shift", "force_shift") if "truncation" in law.parameters else ("",)
        for way in ways:
            chosen = dict(values)
            if way:
                chosen |= {"truncation": way, "cutoff": reach}
            elif law is Charge:
                chosen |= {"cutoff": reach}
            found.append(pytest.param(law, chosen, reach, potential, way, id=f"{law.type}-{way}"))
    return found


def pair(law: Any, way: Any, mass: float = 2.0) -> motes.Simulation:
    """Two particles in a wide periodic box, a way apart."""
    system = motes.System("atoms", mass=mass)
    scene = motes.Scene(
        systems=[system], interact=[law], periodic=motes.Periodic(size=(9,) * 3), step=1e-6,
        integrator="semi_implicit_euler", precision="double",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("atoms", np.array([[0.2, 0.1, 0.3], np.array([0.2, 0.1, 0.3]) + way]))
    return sim


@pytest.mark.parametrize(("law", "values", "reach", "potential", "way"), cases())
@pytest.mark.parametrize("share", [0.45, 0.7, 0.97])
def test_a_law_is_its_formula(
    law: Any, values: dict[str, Any], reach: float, potential: Potential, way: str, share: float
) -> None:
    """U, W = r f and a = f/m of a pair that reaches through two borders, to 12 digits.

    U - U(R) where it is shifted, U - U(R) - (r - R) U'(R) where the force is.
    """
    r = share * reach
    energy, push = float(np.real(potential(r))), -slope(potential, r)
    if way in ("shift", "force_shift"):
        energy -= float(np.real(potential(reach)))
    if way == "force_shift":
        energy -= (r - reach) * slope(potential, reach)
        push += slope(potential, reach)
    unit = np.array([-2.0, 1.0, -2.0]) / 3
    sim = pair(law(**values), r * unit)
    scale = abs(float(np.real(potential(r)))) + abs(r * push)
    assert sim.measure().potential == pytest.approx(energy, abs=1e-12 * scale)
    assert motes.matter.virial(sim) == pytest.approx(r * push, abs=1e-12 * scale)
    stress = sim.virial()
    assert stress == pytest.approx(r * push * np.outer(unit, unit), abs=1e-12 * scale)
    sim.run(steps=1)
    first = np.argmin(sim["atoms"].id)
    a = sim["atoms"].velocity[first] / 1e-6
    assert a == pytest.approx(-push / 2.0 * unit, abs=1e-11 * scale)


def test_every_pair_law_has_its_formula_here() -> None:
    """A law that is added is added above."""
    own = {c for c in catalog("interact").values() if c.__module__.startswith("motes.")}
    assert {c for c in own if c.kernel("force")} == {law for law, *_ in FORMULAS}


@pytest.mark.parametrize(("law", "values", "reach", "potential", "way"), cases())
def test_a_law_ends_at_its_reach(
    law: Any, values: dict[str, Any], reach: float, potential: Potential, way: str
) -> None:
    """There is a force just within it, unless it is 0 there, and none just beyond."""
    del potential, way
    inside, outside = (
        pair(law(**values), np.array([reach * share, 0, 0])) for share in (1 - 1e-6, 1 + 1e-6)
    )
    assert motes.matter.virial(inside) != 0
    assert motes.matter.virial(outside) == 0
    assert outside.measure().potential == 0
    outside.run(steps=1)
    assert (outside["atoms"].velocity == 0).all()
