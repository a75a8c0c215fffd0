"""Boid-steps and agent-steps per second, beside peers in one run: python benchmarks/flocks.py.

Flocks: separation, alignment and cohesion, cruising speed and limits, with about 20 neighbours in
sight of each, in a periodic box, single precision. Peers: the same three rules in plain NumPy on
SciPy's cKDTree (all processors search), and Blender's boids, if a Python with the wheel bpy is
given (`--bpy`, or the environment variable MOTES_BPY). Blender compares every boid with every
other, so that its figure falls with their number; it is measured at 2 000.
Crowds: reciprocal avoidance of the ten nearest, a person on two square metres, everybody with a
goal; the wanted velocities are given and positions advanced; and a scene with forces and a wall.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
from _report import Report, arguments, machine

import motes
from motes.interact.crowd.avoid import Rules, Walls, avoid

SIGHT = 1.0
"""Radius of vision [m]."""
SEEN = 20
"""Neighbours in sight, on average."""
STEP = 0.02
SPEED = 2.0
FEW = 2000
"""Boids of Blender."""


def flock(n: int) -> motes.Simulation:
    """n boids in a periodic box, all in one system."""
    edge = (n * 4 / 3 * np.pi * SIGHT**3 / SEEN) ** (1 / 3)
    boids = motes.System(
        "boids",
        emit=[
            motes.emit.Box(
                burst=[{"count": n}],
                size=(edge,) * 3,
                velocity={"low": [-1.5] * 3, "high": [1.5] * 3},
            )
        ],
        force=[motes.force.Cruise(speed=SPEED), motes.force.Agility(top_speed=2 * SPEED)],
    )
    return motes.Simulation(
        motes.Scene(
            systems=[boids],
            interact=[
                motes.interact.Separation(radius=SIGHT, strength=3.0),
                motes.interact.Alignment(radius=SIGHT),
                motes.interact.Cohesion(radius=SIGHT, strength=2.0),
            ],
            periodic=motes.Periodic(low=(-edge / 2,) * 3, size=(edge,) * 3),
            integrator="semi_implicit_euler",
            step=STEP,
        )
    )


def ours(n: int, seconds: float) -> float:
    """Millions of boid-steps a second, rebuilt lists included."""
    sim = flock(n)
    sim.run(steps=3)
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        sim.run(steps=2)
        steps += 2
    return n * steps / (time.perf_counter() - start) / 1e6


def plain(n: int) -> float:
    """The same rules as arrays over the pairs that a cKDTree finds."""
    from scipy.spatial import cKDTree

    edge = (n * 4 / 3 * np.pi * SIGHT**3 / SEEN) ** (1 / 3)
    rng = np.random.default_rng(0)
    x = rng.uniform(0, edge, (n, 3)).astype(np.float32)
    v = rng.uniform(-1.5, 1.5, (n, 3)).astype(np.float32)

    def step() -> None:
        nonlocal x, v
        tree = cKDTree(x, boxsize=edge)
        pairs = tree.query_pairs(SIGHT, output_type="ndarray")
        i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
        r = x[i] - x[j]
        r -= np.round(r / edge).astype(np.float32) * np.float32(edge)
        d = np.sqrt(np.einsum("ij,ij->i", r, r))
        speed = np.sqrt(np.einsum("ij,ij->i", v, v))
        ahead = -np.einsum("ij,ij->i", v[i], r)
        w = (1 - d / SIGHT) * (ahead >= np.cos(np.radians(135)) * speed[i] * d)
        apart = (1 - d / SIGHT) / np.maximum(d, 1e-6)

        def total(values: Any) -> Any:
            return np.stack([np.bincount(i, values[:, k], n) for k in range(3)], axis=1)

        weight = np.bincount(i, w, n)[:, None] + 0.05
        a = 3 * total(apart[:, None] * r) + 2 * total(w[:, None] * (v[j] - v[i])) / weight
        a -= 2 * total(w[:, None] * r) / (SIGHT * weight)
        a += (SPEED / np.maximum(speed, 1e-10) - 1)[:, None] * v
        v = (v + STEP * a).astype(np.float32)
        x = ((x + STEP * v) % np.float32(edge)).astype(np.float32)
        x[x >= edge] = 0

    times = []
    for _ in range(2):
        start = time.perf_counter()
        step()
        times.append(time.perf_counter() - start)
    return n / min(times) / 1e6


def blender(python: str, n: int) -> float | None:
    """Millions of boid-frames a second of Blender, None where it does not run."""
    program = Path(__file__).parent / "_peer_boids.py"
    try:
        done = subprocess.run(
            [python, str(program), str(n)], capture_output=True, text=True, timeout=100, check=True
        )
        return float(json.loads(done.stdout.strip().splitlines()[-1])["M/s"])
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, IndexError):
        return None


def crowd(n: int, slows: bool, steps: int = 8) -> float:
    """Millions of agent-steps a second."""
    rng = np.random.default_rng(1)
    side = int(np.sqrt(n))
    n, gap = side * side, np.sqrt(2.0)
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side))).reshape(2, -1) * gap
    x = (places + rng.uniform(-0.4, 0.4, (2, n))).astype(np.float32)
    way = rng.uniform(0, 2 * np.pi, n)
    wanted = (1.34 * np.array([np.cos(way), np.sin(way)])).astype(np.float32)
    v = np.zeros_like(wanted)
    law = Rules(3.0, 0.05, 2.0, 0.1, 2.0, slows)
    walls, radius = Walls(np.zeros((n, 0, 3)), np.zeros(n, np.int64)), np.full(n, 0.25, np.float32)
    times = []
    for _ in range(steps):
        start = time.perf_counter()
        v = avoid(x, v, wanted, radius, walls, law, 10)
        x = x + np.float32(0.1) * v
        times.append(time.perf_counter() - start)
    return n / float(np.median(times[2:])) / 1e6


def walkers(n: int, steps: int = 10) -> float:
    """Millions of agent-steps a second of a whole simulation: two streams on a square."""
    edge = float(np.sqrt(2.0 * n))
    systems = [
        motes.System(
            name,
            size=0.5,
            emit=[
                motes.emit.Parties(
                    burst=[{"count": n // 2}], members=1, size=(edge, edge, 0), position=away
                )
            ],
            force=[
                motes.force.Goal(place=place, along=(1, 0, 0), speed={"mean": 1.3, "spread": 0.2}),
                motes.force.Wander(strength=0.3, along=(1, 1, 0)),
            ],
        )
        for name, place, away in (
            ("east", (1e4, 0, 0), (0, 0, 0)),
            ("west", (-1e4, 0, 0), (1, 1, 0)),
        )
    ]
    sim = motes.Simulation(
        motes.Scene(
            systems=systems,
            interact=[motes.interact.Crowd()],
            solid=[motes.solid.Box(position=(0, 0, 1), size=(2, 9, 2), collides=False)],
            integrator="semi_implicit_euler",
            step=0.1,
        )
    )
    sim.run(steps=3)
    start = time.perf_counter()
    sim.run(steps=steps)
    return n * steps / (time.perf_counter() - start) / 1e6


def main() -> None:
    parser = arguments(__doc__ or "")
    parser.add_argument("--bpy", default=os.environ.get("MOTES_BPY", ""), help="Python with bpy")
    options = parser.parse_args()
    n = 200_000 if options.quick else 1_000_000
    report = Report("Flocks and crowds", machine=machine(("scipy",)))
    report.figures["motes, boids"] = (ours(n, 3.0 if options.quick else 8.0), "M boid-steps/s")
    try:
        report.figures["NumPy and cKDTree"] = (plain(n), "M boid-steps/s")
    except ImportError:
        report.notes.append("SciPy is not installed: no figure for NumPy and cKDTree.")
    few = blender(options.bpy, FEW) if options.bpy else None
    if few is None:
        report.notes.append("No Python with bpy was given (--bpy) or it failed: no Blender figure.")
    else:
        report.figures[f"Blender, {FEW} boids"] = (few, "M boid-frames/s")
        report.figures[f"motes, {FEW} boids"] = (ours(FEW, 2.0), "M boid-steps/s")
    report.figures["motes, crowd of 100 000"] = (crowd(100_000, False), "M agent-steps/s")
    report.figures["the same, density slows"] = (crowd(100_000, True), "M agent-steps/s")
    report.figures["100 000 in a scene, with forces and a wall"] = (
        walkers(100_000),
        "M agent-steps/s",
    )
    report.ratio("motes, boids", "NumPy and cKDTree")
    report.ratio(f"motes, {FEW} boids", f"Blender, {FEW} boids")
    report.notes.append(f"{n} boids, about {SEEN} in sight.")
    report.print(options.json)


if __name__ == "__main__":
    main()
