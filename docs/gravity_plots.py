"""Plot gravity to docs/pictures: python docs/gravity_plots.py [NAME].

`gravity_cells`: what one target meets; `gravity_cost`: seconds over n; `gravity_plummer`: what
stays in a Plummer sphere. Needs matplotlib; takes one or two minutes.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.patches import Rectangle

import motes
from motes import gravity
from motes.interact.gravity.acceptance import acceptance, seen
from motes.interact.gravity.lanes import LANES, write
from motes.interact.gravity.multipole import Problem
from motes.interact.gravity.plan import Plan
from motes.interact.gravity.tree import END, FIRST, NUMBER, RADIUS, START, Box, Tree
from motes.interact.gravity.walk import OPENED
from motes.jit import jit
from motes.machine.lanes import choose

FOLDER = Path(__file__).resolve().parent / "pictures"
ORDER, LEAF, ALLOWED = 5, 24, 2e-3
NIGHT, INK = "#0b0e17", "#e8e6df"
MANY = [1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000]
PARTS = (10, 25, 50, 75, 90)
TINTS = ("#7db4ff", "#7fd6c2", "#e8e6df", "#ffc27a", "#ff8a5c")


def disc(n: int) -> Any:
    """A thin exponential disc with two arms."""
    rng = np.random.default_rng(4)
    r = rng.gamma(2.6, 0.95, n)
    arm = np.pi * rng.integers(0, 2, n) + 1.6 * np.log(0.4 + r) + 0.28 * rng.normal(size=n)
    angle = np.where(rng.random(n) < 0.75, arm, rng.uniform(0, 2 * np.pi, n))
    x = np.stack([r * np.cos(angle), r * np.sin(angle), 0.03 * rng.normal(size=n)], axis=1)
    return x[r < 6.5]


IS_FAR = acceptance(ORDER, ORDER, np.float64)


@jit(numba=False)
def judge(balls: Any, chosen: Any, own: Any, stricter: Any, found: Any) -> None:
    """Write whether the chosen cells are far from the ball `own`."""
    far, _ = IS_FAR(seen(balls, chosen), own, (stricter, stricter), 1.0, 0.0, 0.0)
    write(found, 0, choose(far, 1.0, 0.0))


def is_far(tree: Tree, target: int, cell: int) -> bool:
    """Whether the walk takes a cell's expansion for a target cell."""
    chosen, found = np.full(LANES, cell, np.int32), np.zeros(LANES)
    judge(tree.balls, chosen, tree.balls[target], 1 / ALLOWED, found)
    return bool(found[0])


def met(tree: Tree, leaf: int) -> tuple[list[int], list[int]]:
    """Cells whose expansions the leaf's target cells use, and leaves that it sums by pairs."""
    far: list[int] = []
    candidates, target = [0], 0
    while True:
        near: list[int] = []
        inner = tree.cells[target, NUMBER] > 0
        radius = tree.bodies[target, RADIUS]
        while candidates:
            cell = candidates.pop()
            children = children_of(tree, cell)
            if is_far(tree, target, cell):
                far.append(cell)
            elif children and not (inner and tree.bodies[cell, RADIUS] < OPENED * radius):
                candidates += children
            else:
                near.append(cell)
        if not inner:
            return far, near
        start = tree.cells[leaf, START]
        target = next(c for c in children_of(tree, target) if tree.cells[c, END] > start)
        candidates = near


def children_of(tree: Tree, cell: int) -> list[int]:
    """Rows of a cell's children."""
    first = int(tree.cells[cell, FIRST])
    return list(range(first, first + int(tree.cells[cell, NUMBER])))


def cells() -> None:
    """What one target meets: the farther, the more particles in one cell."""
    x = disc(24_000)
    box = Box(x.min(axis=0), float(np.ptp(x, axis=0).max()), 1.0)
    plan = Plan(order=ORDER, low=ORDER, leaf=LEAF, real=np.float64)
    mass = np.full(len(x), 1 / len(x))
    tree = Problem.build(x, mass, None, box, "newton", 0.0, False, plan).sources
    leaves = np.flatnonzero(tree.cells[:, NUMBER] == 0)
    here = np.array([2.1, 1.4, 0.0]) - box.origin
    leaf = int(leaves[np.argmin(((tree.bodies[leaves, :3] - here) ** 2).sum(axis=1))])
    far, near = met(tree, leaf)
    patches, counts = [], []
    for cell in far + near:
        start, end = tree.cells[cell, :2]
        low, high = (f(tree.place[:2, start:end], axis=1) for f in (np.min, np.max))
        patches.append(Rectangle(low, *(high - low)))
        counts.append(end - start)
    figure, axes = plt.subplots(figsize=(9, 9), facecolor=NIGHT, layout="constrained")
    axes.scatter(*tree.place[:2], s=1.1, c=INK, alpha=0.7, linewidths=0)
    shown = PatchCollection(patches[: len(far)], cmap="turbo", alpha=0.34, edgecolor="none")
    shown.set_array(np.log2(counts[: len(far)]))
    axes.add_collection(shown)
    tint = shown.to_rgba(np.log2(counts[: len(far)]))
    axes.add_collection(PatchCollection(patches[: len(far)], facecolor="none", edgecolor=tint))
    axes.add_collection(PatchCollection(patches[len(far) :], facecolor="none", edgecolor="white"))
    axes.plot(*tree.bodies[leaf, :2], "*", color="white", markersize=15)
    axes.set_aspect("equal")
    axes.axis("off")
    whole = matplotlib.cm.ScalarMappable(shown.norm, shown.cmap)
    bar = figure.colorbar(whole, ax=axes, orientation="horizontal", fraction=0.035, pad=0.01)
    bar.set_label("particles in a cell, of which the star feels one expansion", color=INK)
    ticks = np.arange(2, np.log2(max(counts)), 2)
    bar.set_ticks(list(ticks), labels=[f"{2 ** int(k)}" for k in ticks])
    bar.ax.tick_params(colors=INK)
    figure.savefig(FOLDER / "gravity_cells.png", dpi=90)


def cost() -> None:
    """Seconds over n: all pairs, and expansions at two tolerances."""
    figure, (axes,) = night(1, (9, 5.2))
    kinds: dict[str, tuple[float | None, str, list[int]]] = {
        "all pairs": (None, "#ff8a5c", [1_000, 3_000, 10_000, 30_000, 100_000]),
        "tolerance 1e-5": (1e-5, "#7fd6c2", MANY),
        "tolerance 1e-3": (1e-3, "#7db4ff", MANY),
    }
    for label, (tolerance, color, sizes) in kinds.items():
        rows = []
        for n in sizes:
            x = np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32)
            m = np.full(n, 1 / n)
            method = "direct" if tolerance is None else "multipole"
            rows.append((n, seconds(x, m, tolerance, method)))
        axes.loglog(*np.transpose(rows), "o-", color=color, markersize=5)
        slope, power = (2, "n²") if tolerance is None else (1, "n")
        n, last = rows[-1]
        long = MANY if tolerance is None else sizes
        axes.plot(long, [last * (k / n) ** slope for k in long], ":", color=color, linewidth=1)
        axes.annotate(label, (n, last), (9, -4), textcoords="offset points", color=color)
        axes.annotate(
            power, (long[0], last * (long[0] / n) ** slope), (-5, -4), ha="right",
            textcoords="offset points", color=color,
        )  # fmt: skip
    axes.set(xlabel="particles", ylabel="seconds for all accelerations", xlim=(550, 6e6))
    axes.set_title("Gravity of n bodies in single precision", color=INK, loc="left")
    figure.savefig(FOLDER / "gravity_cost.png", dpi=100)


def plummer() -> None:
    """What stays in the gallery's Plummer sphere: radii, the virial ratio, the energy."""
    simulation = motes.Simulation(motes.load("plummer"))
    rows = []
    for frame in simulation.frames():
        if frame.index % 4 == 1:
            now = simulation.measure()
            r = np.linalg.norm(frame.systems["stars"]["position"] - now.center, axis=1)
            rows.append((now.time, now.virial_ratio, now.energy, *np.percentile(r, PARTS)))
    time, ratio, energy, *radii = np.transpose(rows)
    figure, (left, middle, right) = night(3, (13, 4))
    inside = (1 + 1 / float(simulation.scene.systems[0].emit[0].cutoff) ** 2) ** -1.5
    for part, radius, color in zip(PARTS, radii, TINTS, strict=True):
        left.semilogy(time, radius, color=color)
        left.axhline((((part / 100 * inside) ** (-2 / 3)) - 1) ** -0.5, color=color, ls=":", lw=1)
        left.annotate(
            f"{part} %", (time[-1], radius[-1]), (5, -4), textcoords="offset points", color=color
        )
    left.set_title("radii with a share of the mass inside", color=INK, loc="left")
    left.minorticks_off()
    left.set(yticks=[0.5, 1, 2, 4], yticklabels=["0.5", "1", "2", "4"], ylim=(0.42, 4.6))
    left.margins(x=0.12)
    middle.plot(time, ratio, color="#7db4ff")
    middle.axhline(1.0, color=INK, ls=":", lw=1)
    middle.set_ylim(0.9, 1.1)
    middle.set_title("virial ratio 2T / |U|", color=INK, loc="left")
    right.plot(time, 1e4 * (energy / energy[0] - 1), color="#7fd6c2")
    right.axhline(0.0, color=INK, ls=":", lw=1)
    right.set_title("change of energy, in 1/10 000 of it", color=INK, loc="left")
    for axes in (left, middle, right):
        axes.set_xlabel("dynamical times √(a³ / GM)")
    figure.savefig(FOLDER / "gravity_plummer.png", dpi=80)


def night(count: int, size: tuple[float, float]) -> tuple[Any, list[Any]]:
    """A figure with axes side by side, bright on dark."""
    figure, axes = plt.subplots(1, count, figsize=size, facecolor=NIGHT, layout="constrained")
    found = [axes] if count == 1 else list(axes)
    for one in found:
        one.set_facecolor(NIGHT)
        one.tick_params(colors=INK, which="both")
        one.xaxis.label.set_color(INK)
        one.yaxis.label.set_color(INK)
        one.grid(alpha=0.13, color=INK)
        for side, spine in one.spines.items():
            spine.set_color(INK)
            spine.set_alpha(0.5)
            spine.set_visible(side in ("left", "bottom"))
    return figure, found


def seconds(x: Any, m: Any, tolerance: float | None, method: str) -> float:
    """The shortest of some runs, more of short ones, after one that compiles."""
    times = []
    for _ in range(4 if len(x) > 50_000 else 12):
        begun = time.perf_counter()
        gravity.acceleration(x, m, tolerance=tolerance, method=method)
        times.append(time.perf_counter() - begun)
    return min(times[1:])


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    plots = {"gravity_cells": cells, "gravity_cost": cost, "gravity_plummer": plummer}
    for name in sys.argv[1:] or plots:
        plots[name]()
