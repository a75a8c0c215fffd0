"""Particle-steps per second, beside peers in the same run: python benchmarks/particles.py [--json].

Gravity, drag and a vortex by the classical Runge-Kutta method in single precision. The yardstick is
a bare in-place update of the six columns, x += c, on the same threads: what memory allows. Peers
that cannot be imported are left out with a line that says so. Rates are the best of several, taken
in turn.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from _report import Report, arguments, best, machine

import motes
from motes.jit import blocks, jit, share
from motes.memory import allocate

Task = Callable[[], float]
"""Does a share of some work; returns its rate [M/s]."""

STEP = 1e-3
RATE, CORE, STRENGTH = 0.1, 0.1, 2.0
HERE = Path(__file__).parent


def scene(
    n: int, *, integrator: str = "rk4", curves: bool = False, ground: bool = False
) -> motes.Scene:
    """n particles in a box; with `ground`, also a plane that some hit, and 1 % births a step."""
    rate = {"over": "life", "keys": [[0.0, RATE], [1.0, 2 * RATE]]} if curves else RATE
    spin = {"over": "life", "keys": [[0.0, STRENGTH], [1.0, 1.0]]} if curves else STRENGTH
    box = motes.emit.Box(
        burst=[{"at": 0.0, "count": n}], size=(10.0, 10.0, 20.0), position=(0.0, 0.0, 10.0)
    )
    emitters = [box]
    if ground:
        emitters.append(motes.emit.Cone(rate=0.01 * n / STEP, speed=1.0, position=(0.0, 0.0, 5.0)))
    system = motes.System(
        "dust",
        life=1e6 if curves else None,
        emit=emitters,
        force=[
            motes.force.Gravity(),
            motes.force.Drag(rate=rate),
            motes.force.Vortex(strength=spin),
        ],
    )
    solids = [motes.solid.Plane()] if ground else []
    return motes.Scene(systems=[system], solid=solids, step=STEP, integrator=integrator)


def stepping(document: motes.Scene, steps: int, one_by_one: bool = False) -> Task:
    """A simulation's next steps; `one_by_one` keeps it from taking several in one pass."""
    simulation = motes.Simulation(document)
    simulation.run(steps=2)

    def run() -> float:
        work, start = simulation.work, time.perf_counter()
        simulation.run(steps=steps, progress=(lambda _: None) if one_by_one else None)
        return (simulation.work - work) / (time.perf_counter() - start) / 1e6

    return run


def fastest(*tasks: Task, rounds: int) -> list[float]:
    """The best rate of each task. They run in turn, since a shared machine has slow minutes."""
    rates = [[task() for task in tasks] for _ in range(rounds)]
    return [max(column) for column in zip(*rates, strict=True)]


@jit
def _bare(block, c, low, high):  # type: ignore[no-untyped-def]
    x, y, z = block[0][low:high], block[1][low:high], block[2][low:high]
    u, v, w = block[3][low:high], block[4][low:high], block[5][low:high]
    for i in range(x.size):
        x[i] += c
        y[i] += c
        z[i] += c
        u[i] += c
        v[i] += c
        w[i] += c


def bare(n: int) -> Task:
    """Rows of six columns: each is read, added to, written."""
    block, parts = allocate((6, n), np.float32, "the yardstick"), blocks(n, 1 << 17)

    def update() -> float:
        start = time.perf_counter()
        share(lambda k: _bare(block, np.float32(1e-9), *parts[k]), len(parts))
        return n / (time.perf_counter() - start) / 1e6

    update()
    return update


def numpy_step(x: np.ndarray, v: np.ndarray) -> None:
    """One step of the same, by whole arrays, in place."""

    def acceleration(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        a = -RATE * v
        k = STRENGTH / (x[0] * x[0] + x[1] * x[1] + CORE * CORE)
        a[0] -= k * x[1]
        a[1] += k * x[0]
        a[2] -= 9.81
        return a

    h = STEP
    k1, a1 = v, acceleration(x, v)
    k2, a2 = v + h / 2 * a1, acceleration(x + h / 2 * k1, v + h / 2 * a1)
    k3, a3 = v + h / 2 * a2, acceleration(x + h / 2 * k2, v + h / 2 * a2)
    k4, a4 = v + h * a3, acceleration(x + h * k3, v + h * a3)
    x += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def numpy_speed(n: int) -> float:
    """Millions of particle-steps per second of `numpy_step`."""
    rng = np.random.default_rng(0)
    x, v = rng.normal(size=(3, n)).astype(np.float32), np.zeros((3, n), np.float32)
    return n / best(lambda: numpy_step(x, v), 2) / 1e6


def blender_speed(python: str, n: int) -> float | None:
    """Millions of particle-steps per second of Blender, by a Python that has the wheel `bpy`."""
    script = [python, str(HERE / "_peer_blender.py"), str(n)]
    done = subprocess.run(script, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode:
        return None
    return float(json.loads(done.stdout.splitlines()[-1])["M/s"])


def peers(report: Report, n: int, bpy_python: str | None) -> None:
    """Measure what can be imported; say what cannot."""
    report.figures["NumPy"] = numpy_speed(min(n, 1_000_000)), "M/s"
    threads = motes.threads()
    for package, name in (("taichi", f"Taichi ({threads} threads)"), ("warp", "Warp (1 thread)")):
        if importlib.util.find_spec(package) is None:
            report.notes.append(f"{package} is not installed: python3 -m pip install '.[peers]'")
            continue
        with contextlib.redirect_stdout(sys.stderr):  # Where their greetings do no harm.
            peer = importlib.import_module(f"_peer_{package}")
            report.figures[name] = peer.speed(n, threads), "M/s"
        report.ratio("motes", name)
    report.ratio("motes", "NumPy")
    if bpy_python is None:
        report.notes.append("Blender was not asked: give --bpy-python, a Python with the wheel bpy")
        return
    blender = blender_speed(bpy_python, 100_000)
    if blender is None:
        report.notes.append(f"Blender was left out: {bpy_python} cannot run _peer_blender.py")
        return
    report.figures["Blender"] = blender, "M/s"
    report.ratio("motes", "Blender")


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--bpy-python", help="a Python that has Blender's wheel bpy")
    parser.add_argument("--sizes", action="store_true", help="cost per particle by count, too")
    options = parser.parse_args()
    n, steps, rounds = (200_000, 20, 2) if options.quick else (10_000_000, 20, 8)
    report = Report(
        f"{n:,} particles, rk4, single precision: gravity, drag, vortex; M particle-steps/s",
        machine=machine(("taichi", "warp-lang")),
    )

    few = n // 10

    def race(rounds: int, tasks: dict[str, Task]) -> None:
        for name, rate in zip(tasks, fastest(*tasks.values(), rounds=rounds), strict=True):
            report.figures[name] = rate, "M/s"

    grounded, single = "motes, ground and births", "motes, step by step"
    race(
        rounds,
        {
            "bare update": bare(n),
            "motes": stepping(scene(n), steps),
            single: stepping(scene(n), steps, one_by_one=True),
            grounded: stepping(scene(n, ground=True), steps // 5),
        },
    )
    report.ratio("motes", "bare update")
    report.ratio(single, "bare update")
    report.ratio(grounded, "bare update")
    for m in (few, n):
        for method in ("semi_implicit_euler", "rk4"):
            plain, curved = f"{method}, {m:,}", f"{method}, {m:,}, two life curves"
            smooth = scene(m, integrator=method)
            waving = scene(m, integrator=method, curves=True)
            much = n // m
            race(
                rounds // 2,
                {
                    plain: stepping(smooth, much * steps),
                    curved: stepping(waving, much * steps // 2),
                },
            )
            report.ratio(curved, plain)
    if options.sizes:
        tasks = {
            f"motes, {m:,}": stepping(scene(m), steps * max(n // m, 1)) for m in (few, n, 10 * n)
        }
        race(rounds // 2, tasks)
    peers(report, few, options.bpy_python)
    report.print(options.json)


if __name__ == "__main__":
    main()
