"""The form of every benchmark: our figures, peers in the same run, ratios, and the machine."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

SIMD = ("avx512f", "avx2", "avx", "sse2", "neon")


def best(task: Callable[[], object], repeats: int = 5) -> float:
    """Shortest time of a call [s], the first left out."""
    task()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        task()
        times.append(time.perf_counter() - start)
    return min(times)


def best_in_turn(*tasks: Callable[[], object], repeats: int) -> list[float]:
    """Shortest time of each of several tasks [s] that are called in turn."""
    times = [[best(task, 1) for task in tasks] for _ in range(repeats)]
    return [min(column) for column in zip(*times, strict=True)]


def arguments(about: str) -> argparse.ArgumentParser:
    """The options that every benchmark has."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quick", action="store_true", help="smaller and less exact")
    return parser


def machine(packages: tuple[str, ...] = ()) -> dict[str, Any]:
    """Processor, cores, widest SIMD and versions: what the figures hold for."""
    from llvmlite import binding

    import motes

    features = binding.get_host_cpu_features()
    versions = {"Python": platform.python_version()}
    for package in ("numpy", "numba", *packages):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return {
        "processor": binding.get_host_cpu_name(),
        "cores": os.cpu_count(),
        "threads": motes.threads(),
        "SIMD": next((name for name in SIMD if features.get(name)), "none"),
        "versions": versions,
    }


@dataclass
class Report:
    """Figures in the order of measurement; `print` shows them."""

    title: str
    figures: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Value and unit by name."""
    ratios: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    machine: dict[str, Any] = field(default_factory=machine)

    def ratio(self, name: str, over: str) -> None:
        """Add the ratio of two figures, if both were measured."""
        if name in self.figures and over in self.figures:
            self.ratios[f"{name} / {over}"] = self.figures[name][0] / self.figures[over][0]

    def print(self, as_json: bool) -> None:
        """One JSON object, or a table."""
        if as_json:
            print(json.dumps(asdict(self), indent=2))
            return
        facts = self.machine
        versions = ", ".join(f"{k} {v}" for k, v in facts["versions"].items())
        print(self.title)
        print(
            f"{facts['processor']}, {facts['cores']} cores, {facts['threads']} threads, "
            f"{facts['SIMD']}; {versions}\n"
        )
        width = max(map(len, (*self.figures, *self.ratios)), default=0)
        for name, (value, unit) in self.figures.items():
            print(f"{name:{width}}  {value:10.4g} {unit}")
        print()
        for name, value in self.ratios.items():
            print(f"{name:{width}}  {value:10.3g}")
        for note in self.notes:
            print(note)
