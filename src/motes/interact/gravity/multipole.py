"""The fast multipole method: order and acceptance from a tolerance, checked on a sample.

Sources: Greengard and Rokhlin, Journal of Computational Physics 73 (1987) 325; Dehnen,
Computational Astrophysics and Cosmology 1 (2014) 1, for acceptance by an estimate of the error.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

import math
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from motes.interact.gravity.desk import Desk, Limits, desk
from motes.interact.gravity.plan import Plan, plans
from motes.interact.gravity.room import Room, borrowed
from motes.interact.gravity.sample import Sample, sample_of
from motes.interact.gravity.translations import translations
from motes.interact.gravity.tree import (
    START,
    Box,
    Tree,
    octree,
    regrown,
)
from motes.interact.gravity.trees import Kept, Trees
from motes.interact.gravity.upward import divide_work, summarize
from motes.interact.gravity.walk import walker
from motes.jit import blocks, each, jit, share, threads
from motes.machine.lanes import fetch

SAFETY = 0.9
"""Part of the tolerance that the likely error may use, as seen on the sample."""

FIRST, MOST = 2.0, 8.0
"""What one expansion may neglect, in tolerances: at first, and at most, as single large errors
would be missed by the sample."""

MOMENTUM = 0.1
"""The same of the sum of all m a: a sun's hangs on few expansions, whose errors do not cancel."""

ALIKE = 0.1
"""The same of an error that all targets share, in the mean square: where it is of few leaves, the
sample might miss it."""

ENOUGH = 5.0
"""How much less it must neglect at least, or it is made again."""

AIM = 0.92
"""Part of what is allowed that the next trial is to use."""

EASIER = 4.0
"""How many times less an expansion of the lower order may neglect: there are many of them."""

ALONE = 8
"""How many times longer the walk is for a target of the sample: its ways down are for few."""

TRIALS = 8
"""Trials of one plan."""

TASKS, FEWEST_TASKS, PARTICLES_OF_A_TASK = 128, 8, 6144
"""Parts of the walk; each of the threads takes one after the other. A part costs 0.1 ms more."""

BLOCK, AHEAD = 1 << 14, 16
"""Rows that one thread brings back to the caller's order, and how far ahead it looks at places."""

STRICTER, STRICTEST, LOW_ORDER = 10.0, 100.0, 5
"""How much less the walk that the sample is compared with may neglect, and how much below an order:
there errors fall slowly, as many are alike."""

FEW_PAIRS = 1 << 22
"""Pairs of the sample's targets with all sources up to which it is compared with their sum."""


class Units(NamedTuple):
    """What sums are multiplied by in the caller's units."""

    pull: float = 1.0
    depth: float = 1.0
    own: float = 0.0
    """What a unit mass adds to the depth at its own place, and is taken away."""


AS_THEY_ARE = Units()


def multipole(
    source: NDArray[Any],
    mass: NDArray[np.float64],
    target: NDArray[Any] | None,
    box: Box,
    law: str,
    size: float,
    tolerance: float,
    potential: bool,
    units: Units,
    trees: Trees | None = None,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Sums as `direct` gives them, of sources (n, 3) with masses (n,) at targets (k, 3) or sources.

    Points are inside of the box, and they and the masses in the caller's units, `size` in those of
    the box. Returns accelerations (k, 3), and with `potential` potentials (k,), in the precision of
    the sources. The rms error on a sample of targets is at most SAFETY times the tolerance, of
    accelerations and, with `potential`, of potentials. `trees` are those of the last sum, and then
    of this one.
    """
    trees = trees or Trees()
    with borrowed() as room, borrowed() as other:
        particles = source, mass, target, box, law, size, potential
        count = None if target is None else len(target)
        kind = len(source), count, law, size, potential, tolerance, box.length, box.mass
        if again := trees.again(kind):
            problem = Problem.build(*particles, again.plan, room, other, again)
            if trees.do(again, problem):
                return problem.unsorted(problem.solve(again.limits), units, source.dtype)
        for chosen in plans(tolerance, law):
            problem = Problem.build(*particles, chosen, room, other)
            limits = problem.limits_for(tolerance)
            if limits:
                break
        limits = limits or problem.limits(0.0, 0.0, 0.0, 0.0)
        trees.keep(kind, problem, limits)
        return problem.unsorted(problem.solve(limits), units, source.dtype)


@dataclass(frozen=True, eq=False)
class Problem:
    """Two trees and a law, ready to be walked."""

    targets: Tree
    sources: Tree
    law: str
    size: float
    potential: bool
    plan: Plan
    out: NDArray[Any]
    """Room for sums (4, n) or (3, n), in the order of the tree."""
    desks: list[Desk] = field(default_factory=list)
    """Working memory of walks that are over."""

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
        room: Room | None = None,
        other: Room | None = None,
        again: Kept | None = None,
    ) -> Problem:
        """Sort the particles into trees and compute the moments, in a room for the sources and one
        for other targets; or into the cells that they were in."""
        room = room or Room()
        kind = plan.order, law != "plummer", plan.real
        if again:
            tree = regrown(source, mass, box, again.sources, room)
        else:
            tree = octree(source, mass, box, plan.leaf, room)
        sources = summarize(tree, *kind, True, room, plan.mixed)
        targets = sources
        if target is not None:
            equal = np.full(len(target), box.mass / len(target))
            other = other or Room()
            if again:
                tree = regrown(target, equal, box, again.targets, other)
            else:
                tree = octree(target, equal, box, plan.leaf, other)
            targets = summarize(tree, *kind, False, other)
        out = room.array("sums", (4 if potential else 3, targets.place.shape[1]), plan.real)
        return Problem(targets, sources, law, size, potential, plan, out)

    def limits(self, error: float, force: float, alike: float, rounding: float) -> Limits:
        """Limits of the walk; those that depend on the particles alone are filled in."""
        return Limits(
            opening2=self.plan.opening**2,
            error=error,
            easier=EASIER,
            force=force,
            alike=alike,
            rounding=rounding,
            rough=self.plan.rough,
            few=max(self.plan.order**3 // 2, 16),
            size=self.size,
            reach=self.size if self.law == "spline" else 0.0,
            e2=self.size**2 if self.law == "plummer" else 0.0,
        )

    def limits_for(self, tolerance: float) -> Limits | None:
        """Limits of the walk that keep SAFETY times the tolerance on a sample of leaves, if found.

        The error is measured against a walk that neglects much less; it falls at most in proportion
        to what one expansion may neglect. A few leaves cost little, whatever n.
        """
        sample = sample_of(self.targets)
        a = _lengths(self._at(sample, self.limits(math.inf, math.inf, math.inf, math.inf)))
        scale = sample.typical(a)
        pulled = a * self.targets.place[3, sample.rows]
        force = sample.mean_of_most(pulled) * self.targets.place.shape[1] or math.inf
        rounding = tolerance * scale
        alike = ALIKE * rounding * math.sqrt(self.targets.place.shape[1])
        stricter = STRICTER if self.plan.order >= LOW_ORDER else STRICTEST
        share, strictest = tolerance * FIRST, math.inf
        # What pairs are compared with is in double precision where the plan is a mixture.
        strict_rounding = 0.0 if self.plan.mixed else rounding / stricter
        if len(sample.rows) * self.sources.place.shape[1] <= FEW_PAIRS:
            strictest = 0.0
            pairs = self.limits(0.0, 0.0, 0.0, strict_rounding)
            exact = self._at(sample, pairs._replace(rough=False))
        # The walk over all takes time in proportion to part^(-1/3); a trial costs ALONE its share.
        trial = ALONE * len(sample.rows) / self.targets.place.shape[1]
        enough, kept = AIM * max(1.0 - trial, 0.0) ** 3, None
        for _ in range(TRIALS):
            limits = self.limits(share * scale, MOMENTUM * tolerance * force, alike, rounding)
            if share < ENOUGH * strictest:
                strictest = share / stricter
                strict = limits._replace(
                    opening2=limits.opening2 / 2,
                    error=strictest * scale,
                    force=limits.force / stricter,
                    alike=alike / stricter,
                    rounding=strict_rounding,
                    rough=False,
                )
                exact = self._at(sample, strict)
            part = self._error(sample, self._at(sample, limits), exact) / (SAFETY * tolerance)
            if part <= 1.0:
                if kept is not None or part > enough or share >= MOST * tolerance:
                    return limits
                kept = limits
            elif kept is not None:
                return kept
            # A few large errors fall less than in proportion.
            step = AIM / max(part, 1e-9)
            share *= min(max(step * min(math.sqrt(step), 1.0), 0.05), 3.0)
            share = min(share, MOST * tolerance)
        return kept

    def solve(self, limits: Limits) -> NDArray[Any]:
        """Sums (4, k) at all targets, in the order of the tree."""
        n = self.targets.place.shape[1]
        branches = self.targets.cells[divide_work(self.targets)[0][:, 0], :2]
        tasks = min(TASKS, max(n // PARTICLES_OF_A_TASK, FEWEST_TASKS))
        cuts = np.arange(tasks) * n / tasks
        first = np.unique(np.searchsorted(branches[:, START], cuts))
        starts = branches[first[first < len(branches)], START]
        ranges = np.stack([starts, np.append(starts[1:], n)], axis=1)
        return self._walk(np.array_split(ranges, len(ranges)), limits)

    def unsorted(
        self, sums: NDArray[Any], units: Units = AS_THEY_ARE, real: DTypeLike = np.float64
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Accelerations (k, 3), and potentials (k,) or none, in the order in which targets came."""
        n, order, mass = sums.shape[1], self.targets.order, self.targets.place[3]
        pull, depth = np.empty((n, 3), real), np.empty(n if self.potential else 0, real)
        each(unpermute, (sums, order, mass, units, pull, depth), blocks(n, BLOCK))
        return pull, depth

    def _walk(self, parts: list[NDArray[np.int64]], limits: Limits) -> NDArray[Any]:
        """Sums at targets, whole leaves; each part is ranges (k, 2) of rows and one task."""
        plan = self.plan
        kind = plan.real, plan.mixed
        walk = walker(self.law, *kind, self.potential, plan.order, plan.low)
        operations = translations(plan.order, self.law != "plummer", plan.real)
        same, largest, out = self.targets is self.sources, self.targets.largest, self.out
        harmonic = self.law != "plummer"

        def new(candidates: int) -> Desk:
            return desk(operations, harmonic, *kind, largest, candidates)

        desks: SimpleQueue[Desk] = SimpleQueue()
        for _ in range(threads()):
            desks.put(self.desks.pop() if self.desks else new(1 << 16))

        def task(number: int) -> None:
            own = desks.get()
            while walk(self.targets, self.sources, same, parts[number], limits, own, out):
                own = new(2 * own.candidates.size)
            desks.put(own)

        share(task, len(parts))
        self.desks.extend(desks.get() for _ in range(threads()))
        return out

    def _at(self, sample: Sample, limits: Limits) -> NDArray[np.float64]:
        # The targets of a task are near each other: the way down to them is the same for long.
        ascending = sample.ranges[np.argsort(sample.ranges[:, 0])]
        sums = self._walk(np.array_split(ascending, 4 * threads()), limits)
        return sums[:, sample.rows].astype(np.float64)

    def _error(
        self, sample: Sample, tried: NDArray[np.float64], exact: NDArray[np.float64]
    ) -> float:
        lengths = _lengths(exact)
        parts = [(_lengths(tried - exact), lengths)]
        if self.potential:
            parts.append((tried[3] - exact[3], np.abs(exact[3])))
        rounding = 8 * float(np.finfo(self.plan.real).eps)
        errors = [sample.relative(wrong, values, rounding) for wrong, values in parts]
        if self.targets is self.sources:
            mass = self.targets.place[3, sample.rows]
            errors.append(sample.drift(mass * (tried - exact)[:3], mass * lengths))
        return max(errors)


@jit(numba=False)
def unpermute(
    sums: Any, order: Any, mass: Any, units: Units, pull: Any, depth: Any, first: Any, last: Any
) -> None:
    """Write columns `first` to `last` of sums in the tree's order to rows where they came from."""
    for i in range(first, last):
        fetch(pull, 3 * np.intp(order[min(i + AHEAD, last - 1)]))
        row = order[i]
        for axis in range(3):
            pull[row, axis] = np.float64(sums[axis, i]) * units.pull
        if depth.size > 0:
            depth[row] = (np.float64(sums[3, i]) - mass[i] * units.own) * units.depth


def _lengths(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths: NDArray[np.float64] = np.sqrt((sums[:3] ** 2).sum(axis=0))
    return lengths
