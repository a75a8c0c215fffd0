"""Plot the physics of the gallery's matter to docs/pictures: python3 docs/matter_plots.py [NAME].

Needs matplotlib; takes about two minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import motes

FOLDER = Path(__file__).resolve().parent / "pictures"
EVERY = 4
"""Frames from one measured instant to the next."""

LATTICE = 0.6
"""Local order above which an atom counts as part of the lattice."""


def melting(left: Any, right: Any) -> None:
    """Temperature and potential energy of a melt; pairs at a distance before and after."""
    sim = motes.matter.lj_melt(cells=8)
    box = sim.scene.periodic.size
    rows = []
    right.plot(*motes.matter.radial_distribution(crystal(sim), box, 4.5, 150), label="crystal")
    for _ in range(60):
        state = motes.matter.thermo(sim)
        rows.append((sim.time, state.temperature, -state.potential / 5, state.total))
        sim.run(steps=10)
    time, temperature, potential, _ = np.transpose(rows)
    left.plot(time, temperature, label="temperature")
    left.plot(time, potential, label="-potential / 5, per atom")
    left.set(xlabel="time", ylabel="reduced units")
    x = sim["atoms"].position
    right.plot(*motes.matter.radial_distribution(x, box, 4.5, 150), label="liquid")
    right.set(xlabel="distance / sigma", ylabel="g(r)", ylim=(0, 8))


def crystal(sim: motes.Simulation) -> Any:
    """Places after a few steps, when the lattice is whole and its atoms tremble."""
    sim.run(steps=10)
    return sim["atoms"].position


def lj_melting(left: Any, right: Any) -> None:
    """Temperature and share of atoms in the lattice; their order at distances from the middle."""
    sim, rows = motes.Simulation(motes.load("lj_melting")), []
    for number, _ in enumerate(sim.frames()):
        x, v = sim["atoms"].position.astype(float), sim["atoms"].velocity.astype(float)
        if number % (2 * EVERY) == 0:
            order = motes.matter.local_order(x)
            rows.append((sim.time, (v**2).sum(axis=1).mean() / 3, np.mean(order > LATTICE)))
        if number in (0, 120, 168, 239):
            away = np.linalg.norm(x - x.mean(axis=0), axis=1)
            shell = np.digitize(away, np.arange(1, 16))
            order = motes.matter.local_order(x)
            means = [order[shell == k].mean() for k in range(15)]
            right.plot(np.arange(15) + 0.5, means, label=f"t = {sim.time:.1f}")
    time, temperature, ordered = np.transpose(rows)
    left.plot(time, temperature, label="temperature")
    left.plot(time, ordered, label=f"share of atoms of an order above {LATTICE}")
    left.set(xlabel="time", ylabel="reduced units")
    right.set(xlabel="distance from the middle / sigma", ylabel="mean local order")


def splash(left: Any, right: Any) -> None:
    """Energy and height of the drop; the fluid's density over height."""
    rows = []
    sim = motes.Simulation(motes.load("lj_splash"))
    for number, _ in enumerate(sim.frames(last=240)):
        drop = sim["drop"]
        if number % EVERY == 0:
            kinetic = (drop.velocity.astype(float) ** 2).sum(axis=1).mean() / 2
            rows.append((sim.time, kinetic, drop.position[:, 2].mean()))
        if number in (0, 130, 235):
            height = np.concatenate([sim[name].position[:, 2] for name in ("pool", "drop")])
            count, edges = np.histogram(height, np.arange(0, 45, 0.5))
            right.plot(
                (edges[1:] + edges[:-1]) / 2, count / (0.5 * 72**2), label=f"t = {sim.time:.1f}"
            )
    time, kinetic, height = np.transpose(rows)
    left.plot(time, kinetic, label="kinetic energy per atom of the drop")
    left.plot(time, height / 5, label="mean height of the drop / 5")
    left.set(xlabel="time", ylabel="reduced units")
    right.set(xlabel="height / sigma", ylabel="number density", yscale="log")


def granular(left: Any, right: Any) -> None:
    """Kinetic energy of the grains, which collisions use up; heights of the mounds at the end."""
    sim, names, rows = motes.Simulation(motes.load("granular")), ("first", "second", "third"), []
    for number, _ in enumerate(sim.frames()):
        if number % EVERY == 0:
            v = np.concatenate([sim[name].velocity for name in names]).astype(float)
            rows.append((sim.time, (v**2).sum(axis=1).mean() / 2 if len(v) else np.nan))
    left.semilogy(*np.transpose(rows), label="kinetic energy per kilogram")
    left.set(xlabel="time [s]", ylabel="J/kg")
    for name in names:
        count, edges = np.histogram(sim[name].position[:, 2], np.arange(0, 1.3, 0.04))
        right.stairs(count, edges, label=f"{name} mound")
    right.set(xlabel="height [m]", ylabel="grains")


def particle_life(left: Any, right: Any) -> None:
    """Particles near a particle over time; the share of each kind that is near its own."""
    names, radius, rows = ("green", "red", "blue", "white"), 0.17, []
    sim = motes.Simulation(motes.load("particle_life"))
    kind = np.repeat(np.arange(4), [sim[name].position.shape[0] for name in names])
    for number, _ in enumerate(sim.frames(last=90)):
        if number % EVERY == 0:
            x = np.concatenate([sim[name].position for name in names])
            i, j = motes.neighbours.pairs(x, radius)
            i, j = np.concatenate([i, j]), np.concatenate([j, i])  # Each pair from both ends.
            same = [np.mean(kind[j][kind[i] == k] == k) for k in range(4)]
            rows.append((sim.time, len(i) / len(x), *same))
    time, near, *same = np.transpose(rows)
    left.plot(time, near, label=f"neighbours within {radius} m")
    left.set(xlabel="time [s]")
    for name, share in zip(names, same, strict=True):
        colour = "0.6" if name == "white" else name
        right.plot(time, share, color=colour, label=name)
    right.set(xlabel="time [s]", ylabel="neighbours of the same kind")


PLOTS: dict[str, Callable[[Any, Any], None]] = {
    "melting": melting,
    "lj_melting": lj_melting,
    "splash": splash,
    "granular": granular,
    "particle_life": particle_life,
}


def main(names: list[str]) -> None:
    """Draw the named plots, or all."""
    for name in names or PLOTS:
        figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
        PLOTS[name](*axes)
        for one in axes:
            one.margins(y=0.05)
            columns = 2 if len(one.get_legend_handles_labels()[1]) > 2 else 1
            one.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, frameon=False)
            one.spines[["top", "right"]].set_visible(False)
        figure.savefig(FOLDER / f"matter_{name}.png", dpi=90)
        plt.close(figure)


if __name__ == "__main__":
    main(sys.argv[1:])
