"""The fast multipole method: order and acceptance from a tolerance, checked on a sample.

Sources: Greengard and Rokhlin, Journal of Computational Physics 73 (1987) 325; Dehnen,
Computational Astrophysics and Cosmology 1 (2014) 1, for acceptance by an estimate of the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.desk import Desk, Limits, desk
from motes.interact.gravity.expansions import Tables, tables
from motes.interact.gravity.tree import (
    END,
    SKIP,
    START,
    Box,
    Tree,
    divide_work,
    largest_leaf,
    octree,
    summarize,
    unpermute,
)
from motes.interact.gravity.walk import walker
from motes.jit import blocks, share, threads

SINGLE_FROM = 4e-6
"""Smallest tolerance that single precision keeps."""

LEAVES = 64
"""Target leaves on which the error is measured before all are computed."""

SAFETY = 0.7
"""Part of the tolerance that the error on the sample may use."""

FIRST = 24.0
"""First trial of what one expansion may neglect, in units of the tolerance."""

TRIALS = 8
"""Trials before all is summed by pairs."""

STRICTER = 30.0
"""How much less the walk that the sample is compared with may neglect."""


@dataclass(frozen=True)
class Plan:
    """What is chosen from the tolerance alone."""

    order: int
    """Highest degree of the expansions."""
    leaf: int
    """Most particles in a leaf."""
    real: type
    """Precision of expansions and pairs; places are always in double."""
    opening: float = 0.95
    """Largest (r_A + r_B) / R at which expansions are used, whatever their estimate."""


def plan(tolerance: float) -> Plan:
    """Order, leaf size and precision that are fast at a tolerance, found by measurement."""
    digits = -math.log10(tolerance)
    real = np.float32 if tolerance >= SINGLE_FROM else np.float64
    return Plan(order=max(2, round(1.6 * digits)), leaf=128, real=real)


def multipole(
    source: NDArray[Any],
    mass: NDArray[np.float64],
    target: NDArray[Any] | None,
    box: Box,
    law: str,
    size: float,
    tolerance: float,
    potential: bool,
) -> NDArray[np.float64]:
    """Sums as `direct` gives them, of sources (n, 3) with masses (n,) at targets (k, 3) or sources.

    Points are in the caller's units and inside of the box; `size` and the result are in those of
    the box, and the sum of the masses is about 1. Returns (4, k), or (3, k) without `potential`.
    The rms error on a sample of targets is at most SAFETY times the tolerance, of accelerations
    and, with `potential`, of potentials.
    """
    problem = Problem.build(source, mass, target, box, law, size, potential, plan(tolerance))
    return problem.unsorted(problem.solve(problem.limits_for(tolerance)))


@dataclass(frozen=True, eq=False)
class Problem:
    """Two trees and a law, ready to be walked."""

    targets: Tree
    sources: Tree
    table: Tables
    law: str
    size: float
    potential: bool
    plan: Plan

    @staticmethod
    def build(
        source: NDArray[Any],
        mass: NDArray[np.float64],
        target: NDArray[Any] | None,
        box: Box,
        law: str,
        size: float,
        potential: bool,
        plan: Plan,
    ) -> Problem:
        """Sort the particles into trees and compute the moments."""
        table = tables(plan.order, law != "plummer", plan.real)
        sources = summarize(octree(source, mass, box, plan.leaf), table, plan.real, True)
        targets = sources
        if target is not None:
            tree = octree(target, np.full(len(target), 1 / len(target)), box, plan.leaf)
            targets = summarize(tree, table, plan.real, False)
        return Problem(targets, sources, table, law, size, potential, plan)

    def limits(self, error: float, force: float, rounding: float) -> Limits:
        """Limits of the walk; those that depend on the particles alone are filled in."""
        return Limits(
            opening2=self.plan.opening**2,
            error=error,
            force=force,
            rounding=rounding,
            few=self.plan.order**3,
            size=self.size,
            reach=self.size if self.law == "spline" else 0.0,
            e2=self.size**2 if self.law == "plummer" else 0.0,
        )

    def limits_for(self, tolerance: float) -> Limits:
        """Limits of the walk that keep SAFETY times the tolerance on a sample of leaves.

        The error is measured against a walk that neglects much less, and found to be proportional
        to what one expansion may neglect. A few leaves cost next to nothing, whatever n.
        """
        rows, ranges = self._sample()
        a = _lengths(self._at(rows, ranges, self.limits(math.inf, math.inf, math.inf)))
        n = self.targets.place.shape[1]
        scale = _typical(a)
        pulled = a * self.targets.place[3, rows]
        force = n / len(a) * float(_smaller(pulled[pulled > 0]).sum()) or math.inf
        rounding = 0.2 * tolerance * scale
        share = FIRST * tolerance
        for _ in range(TRIALS):
            limits = self.limits(share * scale, share * force, rounding)
            strict = self.limits(*(v / STRICTER for v in (share * scale, share * force, rounding)))
            found = self._error(self._at(rows, ranges, limits), self._at(rows, ranges, strict))
            if found <= SAFETY * tolerance:
                return limits
            share *= max(0.8 * SAFETY * tolerance / found, 0.05)
        return self.limits(0.0, 0.0, 0.0)

    def solve(self, limits: Limits) -> NDArray[Any]:
        """Sums (4, k) at all targets, in the order of the tree."""
        cells = self.targets.cells
        branches, _ = divide_work(self.targets)
        return self._walk([(int(cells[b, START]), int(cells[b, END])) for b in branches], limits)

    def unsorted(self, sums: NDArray[Any]) -> NDArray[np.float64]:
        """Sums in the order in which the targets came."""
        result = np.empty(sums.shape)
        order, ranges = self.targets.order, blocks(sums.shape[1], 1 << 16)

        share(lambda k: unpermute(sums, order, result, *ranges[k]), len(ranges))
        return result

    def _walk(self, ranges: list[tuple[int, int]], limits: Limits) -> NDArray[Any]:
        walk = walker(self.law, self.plan.real, self.potential)
        same, largest = self.targets is self.sources, largest_leaf(self.targets)
        rows = 4 if self.potential else 3
        out: NDArray[Any] = np.empty((rows, self.targets.place.shape[1]), self.plan.real)
        desks: SimpleQueue[Desk] = SimpleQueue()
        for _ in range(threads()):
            desks.put(desk(self.table, self.plan.real, largest, 1 << 16))

        def task(number: int) -> None:
            own = desks.get()
            while walk(
                self.targets, self.sources, same, *ranges[number], self.table, limits, own, out
            ):
                own = desk(self.table, self.plan.real, largest, 2 * own.candidates.size)
            desks.put(own)

        share(task, len(ranges))
        return out

    def _sample(self) -> tuple[NDArray[np.intp], list[tuple[int, int]]]:
        """Leaves spread evenly over the particles: their rows, and their ranges of rows."""
        cells = self.targets.cells
        leaves = cells[cells[:, SKIP] == np.arange(1, len(cells) + 1)]
        n = self.targets.place.shape[1]
        chosen = (np.arange(LEAVES) + 0.5) * n / LEAVES
        numbers = np.unique(np.searchsorted(leaves[:, START], chosen, "right") - 1)
        ranges = [(int(start), int(end)) for start, end, _ in leaves[numbers]]
        return np.concatenate([np.arange(*r) for r in ranges]), ranges

    def _at(
        self, rows: NDArray[np.intp], ranges: list[tuple[int, int]], limits: Limits
    ) -> NDArray[np.float64]:
        return self._walk(ranges, limits)[:, rows].astype(np.float64)

    def _error(self, tried: NDArray[np.float64], exact: NDArray[np.float64]) -> float:
        parts = [(_lengths(tried - exact), _lengths(exact))]
        if self.potential:
            parts.append((tried[3] - exact[3], np.abs(exact[3])))
        return max(_rms(wrong) / (_typical(values) or math.inf) for wrong, values in parts)


def _smaller(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """All but the largest sixteenth.

    Close pairs and large masses may dominate means of few targets by chance, which would allow too
    large errors.
    """
    return np.sort(values)[: len(values) - len(values) // 16]


def _typical(values: NDArray[np.float64]) -> float:
    return _rms(_smaller(values))


def _lengths(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.sqrt((sums[:3] ** 2).sum(axis=0))
    return lengths


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
