"""Gravity of n bodies, beside peers in the same run: python benchmarks/gravity.py [--json].

Equal masses of a Plummer sphere, unsoftened. Errors are rms |a - a_direct| / rms |a| on 300
particles, with direct sums in double precision. Each peer, where it is installed, runs at some of
its own settings, and `gravity.acceleration` at a tolerance with which its measured error is that of
the peer or less, so that a ratio of times never compares us with something more exact. Peers use as
many threads as we do. `--part NAME` measures one part, each in about a minute.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator

import numpy as np
from _report import Report, arguments, best, machine

import motes.jit
from motes import gravity
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.pairs import attraction
from motes.interact.gravity.room import release

SAMPLE = 300

WIDEST = 16
"""Numbers in single precision in the widest vectors there are."""

Accelerations = Callable[[], np.ndarray]


def plummer_sphere(n: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    r = 1 / np.sqrt(rng.random(n) ** (-2 / 3) - 1)
    way = rng.normal(size=(n, 3))
    return r[:, None] * way / np.linalg.norm(way, axis=1)[:, None], np.full(n, 1 / n)


class Cloud:
    """A Plummer sphere that knows the error of accelerations."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.x, self.m = plummer_sphere(n)
        self.rows = np.random.default_rng(1).choice(n, SAMPLE, replace=False)
        self.exact = gravity.acceleration(self.x, self.m, targets=self.x[self.rows])

    def error(self, a: np.ndarray) -> float:
        return float(np.sqrt(((a[self.rows] - self.exact) ** 2).sum() / (self.exact**2).sum()))

    def ours(self, tolerance: float) -> Accelerations:
        return lambda: gravity.acceleration(self.x, self.m, tolerance=tolerance, method="multipole")


def inner_loops() -> list[float]:
    """Pairs per second [G/s] of the innermost loop, in single precision, on data in the cache: with
    pairs that are not rough, and that are, in turn."""
    rng = np.random.default_rng(0)
    target, source = (rng.random((rows, 1024), np.float32) for rows in (3, 4))
    total, size = np.zeros((5, 1024), np.float32), np.float32(0)

    def seconds(rough: bool) -> float:
        attract = attraction("newton", np.float32, False, rough=rough)
        return best(lambda: attract(target, 1024, source, 1024, (0, 0, 0), size, total), 5)

    rounds = [[seconds(rough) for rough in (False, True)] for _ in range(40)]
    return [1024**2 / min(times) / 1e9 for times in zip(*rounds, strict=True)]


def direct(report: Report, n: int) -> None:
    x, m = plummer_sphere(n)
    every = motes.jit.threads()
    for real, name in ((np.float32, "single"), (np.float64, "double")):
        points = x.astype(real)
        for count in sorted({1, every}):
            motes.jit.threads(count)
            seconds = best(lambda p=points: gravity.acceleration(p, m), 3)
            label = f"direct, {name}, {count} thread{'s' * (count > 1)}"
            report.figures[label] = (n * n / seconds / 1e9, "G pairs/s")
    motes.jit.threads(every)
    loop, rough = inner_loops()
    report.figures["its inner loop in the cache"] = (loop, "G pairs/s")
    report.ratio("direct, single, 1 thread", "its inner loop in the cache")
    report.figures["the same of rough pairs"] = (rough, "G pairs/s")
    report.ratio("the same of rough pairs", "its inner loop in the cache")
    report.figures["numbers in a vector, single"] = (LANES, "")
    if LANES < WIDEST:
        report.notes.append(
            f"This processor's vectors hold {LANES} numbers in single precision; one with AVX-512 "
            f"sums {WIDEST} pairs in as many instructions, which cannot be measured here."
        )


def multipole(report: Report, sizes: list[int]) -> None:
    for n in sizes:
        cloud = Cloud(n)
        for tolerance in (1e-3, 1e-5):
            task = cloud.ours(tolerance)
            error, seconds = cloud.error(task()), best(task, 10 if n < 5_000_000 else 3)
            label = f"n = {n:.0e}, tolerance {tolerance:.0e}"
            report.figures[label] = (seconds, "s")
            report.figures[f"{label}, a particle"] = (seconds / n * 1e6, "us")
            report.figures[f"{label}, error"] = (error, "")


def memory(report: Report, n: int) -> None:
    cloud = Cloud(n)
    for tolerance in (1e-3, 1e-5):
        task = cloud.ours(tolerance)
        task()
        release()  # What is kept from one sum to the next is counted, too.
        tracemalloc.start()
        task()
        label = f"most memory beyond x and m, {tolerance:.0e}"
        report.figures[label] = (tracemalloc.get_traced_memory()[1] / n, "B a particle")
        tracemalloc.stop()


def pytreegrav_tasks(cloud: Cloud) -> Iterator[tuple[str, Accelerations]]:
    try:
        import numba
        import pytreegrav
    except ImportError:
        return
    numba.set_num_threads(motes.jit.threads())
    for theta, quadrupole in ((0.7, False), (0.7, True), (0.4, True)):
        name = f"pytreegrav, theta {theta}, {'quadrupole' if quadrupole else 'monopole'}"
        yield (
            name,
            lambda t=theta, q=quadrupole: pytreegrav.Accel(
                cloud.x, cloud.m, theta=t, quadrupole=q, parallel=True, method="tree"
            ),
        )


def fmm3dpy_tasks(cloud: Cloud) -> Iterator[tuple[str, Accelerations]]:
    try:
        import fmm3dpy
    except ImportError:
        return
    points = np.asfortranarray(cloud.x.T)

    def gradient(eps: float) -> np.ndarray:
        # Its potential is q / (4 pi r).
        found = fmm3dpy.lfmm3d(eps=eps, sources=points, charges=cloud.m, pg=2)
        return 4 * np.pi * np.asarray(found.grad).T

    for eps in (1e-3, 1e-4):  # A smaller eps has the error of 1e-4 at these numbers.
        yield f"fmm3dpy, eps {eps:.0e}", lambda e=eps: gradient(e)


def peers(report: Report, n: int, tasks: Callable[[Cloud], Iterator[tuple[str, Accelerations]]],
          compiles: bool) -> None:  # fmt: skip
    """A peer's times and errors, and ours at the same errors; its first call may be compiling."""
    cloud = Cloud(n)
    for name, task in tasks(cloud):
        begun = time.perf_counter()
        error = cloud.error(task())
        first = time.perf_counter() - begun
        report.figures[name] = (best(task, 1) if compiles else first, "s")
        report.figures[f"{name}, error"] = (error, "")
        if 1e-10 <= error < 1:
            ours = f"motes, as exact as {name}"
            run, found = as_exact(cloud, error)
            report.figures[ours] = (best(run, 3), "s")
            report.figures[f"{ours}, error"] = (found, "")
            report.ratio(name, ours)


def as_exact(cloud: Cloud, error: float) -> tuple[Accelerations, float]:
    """Our sums whose measured error is an error or somewhat less, and what it is.

    A tolerance is an upper limit: at one equal to the error we are more exact than was asked.
    """
    first = cloud.ours(error)
    found = cloud.error(first())
    second = cloud.ours(error * (error / found) ** 0.7)
    closer = cloud.error(second())
    return (second, closer) if closer <= error else (first, found)


CROSSINGS = [2_000, 4_000, 8_000, 16_000, 32_000]


def crossovers(report: Report, sizes: list[int]) -> None:
    """Seconds of both methods where they are about as fast."""
    for real in (np.float32, np.float64):
        for n in sizes:
            x, m = plummer_sphere(n)
            points, name = x.astype(real), np.dtype(real).name
            seconds = best(lambda p=points, w=m: gravity.acceleration(p, w), 3)
            report.figures[f"{name}, n = {n}, direct"] = (seconds * 1e3, "ms")
            for tolerance in (1e-3, 1e-5, *([1e-6, 1e-8] if real is np.float64 else [])):
                law = {"tolerance": tolerance, "method": "multipole"}
                task = lambda p=points, w=m, k=law: gravity.acceleration(p, w, **k)  # noqa: E731
                task()
                label = f"{name}, n = {n}, tolerance {tolerance:.0e}"
                report.figures[label] = (best(task, 3) * 1e3, "ms")


def again(report: Report, sizes: list[int]) -> None:
    """Sums while particles move little, with new trees and with those of the sum before."""
    for n in sizes:
        x, m = plummer_sphere(n)
        v = np.random.default_rng(2).normal(size=x.shape)
        kinds = {"new trees": None, "trees again": gravity.Trees()}
        times: dict[str, list[float]] = {kind: [] for kind in kinds}
        for _ in range(12):
            x += 6e-4 * v
            for kind, trees in kinds.items():
                law = {"tolerance": 1e-3, "method": "multipole", "trees": trees}
                times[kind].append(best(lambda p=x, w=m, k=law: gravity.acceleration(p, w, **k), 1))
        for kind, seconds in times.items():
            report.figures[f"n = {n:.0e}, {kind}"] = (float(np.median(seconds)) * 1e3, "ms")
        report.ratio(f"n = {n:.0e}, trees again", f"n = {n:.0e}, new trees")


def starts(report: Report, tolerances: list[float]) -> None:
    for tolerance in tolerances:
        label = f"first call at {tolerance:.0e}, empty kernel cache"
        report.figures[label] = (first_call(tolerance), "s")


def first_call(tolerance: float) -> float:
    """Seconds of a first call in a new process with an empty kernel cache, without imports."""
    program = (
        "import numpy, time; from motes import gravity; x = numpy.random.rand(20000, 3);"
        "t = time.time();"
        f"gravity.acceleration(x, x[:, 0], tolerance={tolerance}, method='multipole');"
        "print(time.time() - t)"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"MOTES_CACHE": folder}
        run = [sys.executable, "-c", program]
        return float(subprocess.run(run, env=environment, check=True, capture_output=True).stdout)


PARTS: dict[str, Callable[[Report, bool], None]] = {
    "direct": lambda report, quick: direct(report, 20_000 if quick else 65_536),
    "multipole": lambda report, quick: multipole(report, [100_000] + [1_000_000] * (not quick)),
    "large": lambda report, quick: multipole(report, [10_000_000] * (not quick)),
    "again": lambda report, quick: again(report, [100_000] + [1_000_000] * (not quick)),
    "memory": lambda report, quick: memory(report, 100_000 if quick else 1_000_000),
    "pytreegrav": lambda report, quick: peers(
        report, 20_000 if quick else 200_000, pytreegrav_tasks, True
    ),
    "fmm3dpy": lambda report, quick: peers(
        report, 20_000 if quick else 100_000, fmm3dpy_tasks, False
    ),
    "crossover": lambda report, quick: crossovers(report, [4_000] if quick else CROSSINGS),
    "start": lambda report, quick: starts(report, [1e-3] if quick else [1e-3, 1e-5, 1e-8]),
}


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--part", choices=PARTS, action="append", help="measure this part only")
    options = parser.parse_args()
    report = Report("Gravity", machine=machine(("pytreegrav", "fmm3dpy")))
    begun = time.perf_counter()
    for part in options.part or PARTS:
        PARTS[part](report, options.quick)
    report.notes.append(f"measured in {time.perf_counter() - begun:.0f} s")
    report.print(options.json)


if __name__ == "__main__":
    main()
