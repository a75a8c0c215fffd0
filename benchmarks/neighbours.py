"""Time to find neighbours, beside peers in the same run: python benchmarks/neighbours.py [--json].

Points spread evenly over a periodic unit box, in double precision; a radius that holds 30
neighbours on average, and the 8 nearest. Each time is the best of several and includes all that a
call needs from bare arrays: trees and cells too. Peers, where they are installed: SciPy's cKDTree
(pairs on one thread, as it offers no more; the nearest on ours), freud (single precision, as it
always is) and matscipy, whose lists hold each pair twice and are timed beside our `within`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator

import numpy as np

import motes.jit
from motes import neighbours

NEIGHBOURS = 30
NEAREST = 8
PATIENCE = 10.0
"""Seconds after which a task is not repeated."""

Task = tuple[str, str, Callable[[], object]]


def best(task: Callable[[], object], repeats: int) -> float:
    """Shortest time of a call [s]."""
    times: list[float] = []
    while len(times) < repeats and sum(times) < PATIENCE:
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


def ours(x: np.ndarray, radius: float) -> Iterator[Task]:
    yield "pairs", "motes", lambda: neighbours.pairs(x, radius, 1.0)
    yield "both ways", "motes", lambda: neighbours.within(x, radius, box=1.0)
    yield "nearest", "motes", lambda: neighbours.nearest(x, NEAREST, 1.0)


def scipy_tasks(x: np.ndarray, radius: float) -> Iterator[Task]:
    try:
        from scipy.spatial import cKDTree
    except ImportError:
        return
    threads = motes.jit.threads()

    def tree() -> cKDTree:
        return cKDTree(x, boxsize=1.0)

    yield "pairs", "cKDTree", lambda: tree().query_pairs(radius, output_type="ndarray")
    yield "both ways", "cKDTree", lambda: tree().query_ball_point(x, radius, workers=threads)
    yield "nearest", "cKDTree", lambda: tree().query(x, NEAREST + 1, workers=threads)


def freud_tasks(x: np.ndarray, radius: float) -> Iterator[Task]:
    try:
        import freud
    except ImportError:
        return
    freud.set_num_threads(motes.jit.threads())
    box, centered = freud.box.Box.cube(1.0), (x - 0.5).astype(np.float32)

    def query(**wanted: float) -> object:
        tree = freud.locality.AABBQuery(box, centered)
        return tree.query(centered, {**wanted, "exclude_ii": True}).toNeighborList()

    yield "both ways", "freud", lambda: query(r_max=radius)
    yield "nearest", "freud", lambda: query(num_neighbors=NEAREST)


def matscipy_tasks(x: np.ndarray, radius: float) -> Iterator[Task]:
    try:
        from matscipy.neighbours import neighbour_list
    except ImportError:
        return
    cell = {"positions": x, "cell": np.eye(3), "pbc": [True] * 3}
    yield "both ways", "matscipy", lambda: neighbour_list("ij", cutoff=radius, **cell)


def measure(n: int, repeats: int, tasks: list[str]) -> dict[str, dict[str, float]]:
    """Seconds by task and program; the first call of ours, which may compile, is left out."""
    x = np.random.default_rng(0).random((n, 3))
    radius = (NEIGHBOURS / (4 / 3 * np.pi * n)) ** (1 / 3)
    seconds: dict[str, dict[str, float]] = {}
    for source in (ours, scipy_tasks, freud_tasks, matscipy_tasks):
        for task, program, call in source(x, radius):
            if task not in tasks:
                continue
            if source is ours:
                call()
            seconds.setdefault(task, {})[program] = best(call, repeats)
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--points", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--tasks", nargs="+", default=["pairs", "both ways", "nearest"])
    arguments = parser.parse_args()
    seconds = {n: measure(n, arguments.repeats, arguments.tasks) for n in arguments.points}
    ratios = {
        n: {
            task: {peer: value / by["motes"] for peer, value in by.items() if peer != "motes"}
            for task, by in tasks.items()
        }
        for n, tasks in seconds.items()
    }
    if arguments.json:
        every = {"threads": motes.jit.threads(), "seconds": seconds, "ratios": ratios}
        print(json.dumps(every, indent=2))
        return
    print(f"{NEIGHBOURS} neighbours, {NEAREST} nearest, {motes.jit.threads()} threads")
    for n, tasks in seconds.items():
        for task, by in tasks.items():
            for program, value in by.items():
                ratio = ratios[n][task].get(program)
                times = "" if ratio is None else f"{ratio:7.1f} times ours"
                print(f"{n:9} points  {task:10} {program:9} {value:9.3f} s {times}")


if __name__ == "__main__":
    main()
