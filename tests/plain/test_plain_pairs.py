"""Laws of limited reach against their definition: a double loop over all particles."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import component, quantity
from motes.kernel import kernel

BOX = np.array([7.0, 8.0, 9.0])


@component(kind="interact", name="test_push")
class Push:
    """A pair law with masses: f = strength m_a m_b (1 - r/radius)^2 along r."""

    strength = quantity(3.0, "N/kg2", scope="scene")
    """Strength."""

    radius = quantity(1.9, "m", above=0, scope="scene")
    """Support radius."""

    needs = ("mass",)

    def reach(p: Any) -> Any:
        return p.radius

    def constants(p: Any) -> Any:
        return {"inverse": 1 / p.radius}

    @kernel
    def force(p: Any, a: Any, b: Any, r: Any) -> Any:
        u = 1.0 - r.length * p.inverse
        f = p.strength * a.mass * b.mass * u * u / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p: Any, a: Any, b: Any, r: Any) -> Any:
        return p.strength * a.mass * b.mass * p.radius * (1.0 - r.length * p.inverse) ** 3 / 3.0


@component(kind="interact", name="test_gather")
class Gather:
    """A gathering law: towards the mean place and motion of neighbours, weighted by their size."""

    radius = quantity(1.6, "m", above=0, scope="scene")
    """Support radius."""

    axis = quantity((0.5, 1.0, 2.0), "", scope="scene")
    """Weights of the axes."""

    needs = ("size",)

    def reach(p: Any) -> Any:
        return p.radius

    @kernel
    def near(p: Any, a: Any, b: Any, r: Any) -> Any:
        w = b.size * (p.radius - r.length)
        return w, w * r.x, w * r.y, w * r.z, b.vx - a.vx, 1.0

    @kernel
    def acceleration(p: Any, a: Any, s: Any) -> Any:
        w = 1.0 / (a.size + s[0])
        k = p.axis
        return s[4] / (1.0 + s[5]) - w * k[0] * s[1], -w * k[1] * s[2], a.vz - w * k[2] * s[3]


def scene(periodic: bool, law: Any, precision: str, **settings: Any) -> motes.Scene:
    """Three systems in a box; one is lighter and smaller by draw."""
    at = {"size": tuple(BOX), "position": tuple(BOX / 2), "speed": 0.3, "angle": 180.0}
    systems = [
        motes.System("a", emit=[motes.emit.Box(burst=[{"count": 260}], **at)], size=0.25),
        motes.System(
            "b",
            emit=[motes.emit.Box(burst=[{"count": 150}], **at)],
            mass={"mean": 2.0, "spread": 1.0},
            size={"mean": 0.2, "spread": 0.1},
        ),
        motes.System("c", emit=[motes.emit.Box(burst=[{"count": 70}], **at)]),
    ]
    whole = {"size": tuple(BOX)} if periodic else {}
    return motes.Scene(
        systems=systems, interact=[law], periodic=whole, precision=precision, step=1e-3, **settings
    )


def columns(sim: motes.Simulation, name: str) -> dict[str, np.ndarray]:
    view = sim[name]
    x, v = view.position.astype(float), view.velocity.astype(float)
    return {
        **dict(zip("xyz", x.T, strict=True)),
        **dict(zip(("vx", "vy", "vz"), v.T, strict=True)),
        "mass": view.mass.astype(float),
        "size": view.size.astype(float),
        "id": view.id.copy(),
    }


def plain(
    law: Any, systems: dict[str, Any], targets: Any, sources: Any, periodic: bool, nearest: int = 0
) -> dict[str, np.ndarray]:
    """Accelerations by the definition."""
    part = type(law)
    p = SimpleNamespace(**{k: getattr(law, k) for k in part.own})
    p.__dict__.update(part.kernel("constants")(p) if part.kernel("constants") else {})
    reach, result = part.kernel("reach")(p), {}
    for name in targets:
        here = systems[name]
        result[name] = np.zeros((here["x"].size, 3))
        for i in range(here["x"].size):
            a = SimpleNamespace(**{k: c[i] for k, c in here.items()})
            found = []
            for other in sources:
                there = systems[other]
                r = np.stack([here[k][i] - there[k] for k in "xyz"])
                if periodic:
                    r -= BOX[:, None] * np.round(r / BOX[:, None])
                length = np.sqrt((r**2).sum(axis=0))
                for j in np.flatnonzero(length <= reach):
                    if other != name or i != j:
                        b = SimpleNamespace(**{k: c[j] for k, c in there.items()})
                        found.append((length[j], r[:, j], b))
            found.sort(key=lambda one: one[0])
            total = 0.0
            for length, r, b in found[: nearest or None]:
                way = SimpleNamespace(x=r[0], y=r[1], z=r[2], square=length**2, length=length)
                total = total + np.array(
                    part.kernel("force" if "force" in vars(part) else "near")(p, a, b, way)
                )
            if "force" in vars(part):
                result[name][i] = total / a.mass
            else:
                sums = total if found else np.zeros(6)
                result[name][i] = part.kernel("acceleration")(p, a, sums)
    return result


CASES = list(product((False, True), ("single", "double"), ("force", "near", "nearest")))


@pytest.mark.parametrize(("periodic", "precision", "form"), CASES)
def test_laws_are_their_double_loops(periodic: bool, precision: str, form: str) -> None:
    """One Euler step gives v + h a; a is compared with the loop over all pairs."""
    common = {"systems": ["a", "b"], "sources": ["b"]} if form != "force" else {}
    if form == "nearest":
        common["nearest"] = 3
    law: Any = Push(**common) if form == "force" else Gather(**common)
    names = ("a", "b", "c") if form == "force" else ("a", "b")
    sources = names if form == "force" else ("b",)
    sim = motes.Simulation(scene(periodic, law, precision, integrator="semi_implicit_euler"))
    sim.run(steps=1)
    before = {name: columns(sim, name) for name in ("a", "b", "c")}
    sim.run(steps=1)
    expected = plain(law, before, names, sources, periodic, common.get("nearest", 0))
    for name in names:
        after = columns(sim, name)
        place = {int(k): i for i, k in enumerate(after["id"])}
        rows = [place[int(k)] for k in before[name]["id"]]
        for k, axis in enumerate(("vx", "vy", "vz")):
            a = (after[axis][rows] - before[name][axis]) / 1e-3
            scale = np.abs(expected[name]).max()
            bound = 2e-3 if precision == "single" else 1e-11  # Rounding of v, divided by h.
            assert np.abs(a - expected[name][:, k]).max() < bound * scale


def test_the_energy_of_pairs_is_their_double_loop() -> None:
    """U = sum over pairs of two sources once, and over a passive particle's sources."""
    law = Push(sources=["b"])
    sim = motes.Simulation(scene(True, law, "double", integrator="leapfrog"))
    sim.run(steps=1)
    systems = {name: columns(sim, name) for name in ("a", "b", "c")}
    p = SimpleNamespace(strength=3.0, radius=1.9, inverse=1 / 1.9)
    total = 0.0
    for name, here in systems.items():
        there = systems["b"]
        r = np.stack([here[k][:, None] - there[k][None] for k in "xyz"])
        r -= BOX[:, None, None] * np.round(r / BOX[:, None, None])
        length = np.sqrt((r**2).sum(axis=0))
        a, b = (
            SimpleNamespace(mass=here["mass"][:, None]),
            SimpleNamespace(mass=there["mass"][None]),
        )
        u = type(law).kernel("potential")(p, a, b, SimpleNamespace(length=length))
        near = (length <= 1.9) & (length > 0)
        total += (0.5 if name == "b" else 1.0) * u[near].sum()
    assert sim.measure().potential == pytest.approx(total, rel=1e-12)
