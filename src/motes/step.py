"""One time step. This is the page to read first.

A step takes the state from t to t + h in phases: births at their own instants, integration of the
rows that were alive, exceptions (newborns, and rows that may meet a solid), events, deaths. Every
particle feels the forces at the exact times of the method's stages; none is advanced before
another that it could feel.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.system import CompiledSystem
from motes.emission import Clock, Source
from motes.errors import SceneError
from motes.jit import blocks, bound, share
from motes.state import Particles

LARGEST_BLOCK = 1 << 18
"""Rows of one kernel call: a few milliseconds, so that Ctrl-C works."""

SMALLEST_BLOCK = 1 << 14
"""Rows below which a second thread costs more than it brings."""

GLIDING = 1 << 15
"""Rows that take several steps before the next ones do: about what a core's cache keeps."""

MANY = 2048
"""Newborns in a step from which a SIMD kernel of their own is worth its compilation."""

NOTHING: NDArray[np.int64] = np.zeros(0, np.int64)
"""No rows."""


ROUNDED = 1e-5
"""Share of an age by which single precision may be wrong, with some to spare."""


@dataclass(frozen=True)
class Interval:
    """The step that is being taken; one step's `end` is the next one's `begin`, to the last bit."""

    begin: float
    end: float

    @property
    def length(self) -> float:
        """Length of the step [s]."""
        return self.end - self.begin


class Stepper:
    """Steps one system: its compiled kernels, its emitters' clocks, its room for flags."""

    def __init__(
        self, system: CompiledSystem, clocks: list[Clock], seed: int, capacity: int | None
    ) -> None:
        self.system, self.clocks, self.capacity = system, clocks, capacity
        self.seed = np.uint64(seed)
        self.flags: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self.held = NOTHING
        self._steps: dict[Any, tuple[tuple[Any, ...], Any]] = {}
        self.impacts = 0

    def step(self, rows: Particles, interval: Interval) -> None:
        """Take the system through one step, in place."""
        alive = self.births(rows, interval)
        exceptional = np.concatenate(
            [self.integrate(rows, alive, interval), self.newborns(rows, alive, interval)]
        )
        self.exceptions(rows, exceptional, interval)
        self.events()
        self.deaths(rows, exceptional, interval)

    def undisturbed(self, rows: Particles, begin: float, end: float, step: float) -> bool:
        """Whether nothing is born, dies or meets a solid in some steps: rows only move."""
        if self.system.surfaces is not None or end >= self._first_death(rows, step):
            return False
        return all(clock.silent(begin, end) for clock in self.clocks)

    def _first_death(self, rows: Particles, step: float) -> float:
        """A time before which nobody dies, as far as that is known without a look at all rows.

        Rows are in the order of the steps in which they were born, so that nobody is older than the
        first one by more than a step.
        """
        motion = self.system.motion
        if not motion.mortal or rows.count == 0:
            return math.inf
        if any(component.type != "lifetime" for _, component in motion.retire):
            return -math.inf
        shortest = motion.traits["life"][1].bounds()[0]
        return float(rows.birth[0]) - 2 * step + shortest * (1 - ROUNDED)

    def glide(self, rows: Particles, intervals: Sequence[Interval]) -> None:
        """Take undisturbed rows through several steps, in place.

        A block of rows goes through all of them while it is in a cache, and then the next one.
        """
        step, parts = self._bound(self.system.straight, rows), _parts(rows.count, 1)

        def straight(k: int) -> None:
            first, last = parts[k]
            for low in range(first, last, GLIDING):  # Whole chunks of the pass, so the same bits.
                for interval in intervals:
                    step(interval.begin, interval.end, low, min(low + GLIDING, last))

        share(straight, len(parts))

    def mass(self, rows: Particles, alive: int) -> NDArray[Any]:
        """Masses [kg] of the rows that were alive, (alive,)."""
        return self.trait("mass", rows, alive, 0.0)

    def trait(self, name: str, rows: Particles, alive: int, time: float) -> NDArray[Any]:
        """A trait of one number (mass, size, life) of the rows that were alive, (alive,)."""
        if name not in self.system.motion.traits:
            menu = ", ".join(self.system.motion.traits)
            raise SceneError(f'system "{rows.name}" has no {name}. It has {menu}.')
        address, control = self.system.motion.traits[name]
        start = 0
        for column in self.system.columns:
            if column.address == address:
                return rows.columns[start][:alive]
            start += column.width
        if control.scope == "scene":
            return np.full(alive, float(control.at(time)[0]), rows.real)
        raise SceneError(
            f'system "{rows.name}": laws between particles need a {name} that does not run over '
            "life or speed."
        )

    def numbers(self, rows: Particles, alive: int, time: float) -> NDArray[np.int64]:
        """Which births the rows that were alive are (2, alive): number of the stream, and k."""
        found: NDArray[np.int64] = np.full((2, alive), -1)
        for e, clock in enumerate(self.clocks):
            stream, number = clock.numbers(rows.ids[:alive], time)
            own = stream >= 0
            found[0, own], found[1, own] = stream[own] * len(self.clocks) + e, number[own]
        return found

    def births(self, rows: Particles, interval: Interval) -> int:
        """Append the newborns of the step, as they are at their own instants.

        Returns how many rows are alive all through the step: those from before, and then those
        that were born at the very instant at which it begins.
        """
        if not self.clocks:
            return rows.count
        born = [
            (clock.name, source)
            for clock in self.clocks
            for source in clock.sources(interval.begin, interval.end)
        ]
        at_once = [pair for pair in born if pair[1].times[-1] <= interval.begin]
        later = [pair for pair in born if pair[1].times[-1] > interval.begin]
        self._append(rows, at_once)
        alive = rows.count
        self._append(rows, later)
        return alive

    def _append(self, rows: Particles, born: list[tuple[str, Source]]) -> None:
        for name, source in born:
            count = len(source.times)
            if self.capacity is not None:
                count = min(count, self.capacity - rows.count)
            if count <= 0:
                continue
            rows.reserve(count)
            self._write(rows, name, source, count)
            rows.forget(slice(rows.count, rows.count + count))
            rows.count += count

    def _write(self, rows: Particles, name: str, source: Source, count: int) -> None:
        emitter = self.system.emitters[name]
        channels, first = self.system.trait_channels, rows.count
        parts = _parts(count, 16)

        def write(k: int) -> None:
            low, high = parts[k]
            emitter.kernel(
                rows.position, rows.velocity, rows.birth, rows.ids, rows.columns, first + low,
                source.times[low:high], source.numbers[low:high], np.uint64(source.address),
                self.seed, emitter.K, emitter.channels, self.system.K_traits, channels,
            )  # fmt: skip

        share(write, len(parts))

    def integrate(self, rows: Particles, alive: int, interval: Interval) -> NDArray[np.int64]:
        """Take the rows that were alive through the step; returns those that may meet a solid."""
        return self._straight(self.system.straight, rows, 0, alive, interval)

    def newborns(self, rows: Particles, alive: int, interval: Interval) -> NDArray[np.int64]:
        """Take newborns, if they are many, to the step's end; returns those that need care."""
        if rows.count - alive < MANY or self.system.young is None:
            return np.arange(alive, rows.count)
        return self._straight(self.system.young, rows, alive, rows.count, interval)

    def _straight(
        self, kernel: Any, rows: Particles, first: int, last: int, interval: Interval
    ) -> NDArray[np.int64]:
        step, parts = self._bound(kernel, rows), _parts(last - first, 1)
        held = [NOTHING] * len(parts)

        def straight(k: int) -> None:
            low, high = first + parts[k][0], first + parts[k][1]
            count = step(interval.begin, interval.end, low, high)
            if count:
                held[k] = self.held[low : low + count]

        share(straight, len(parts))
        return np.concatenate([NOTHING, *held])

    def _bound(self, kernel: Any, rows: Particles) -> Any:
        """A kernel with the arrays that it works on, which are the same from step to step until
        there are more rows than they hold."""
        arrays = (
            rows.position, rows.velocity, rows.birth, rows.columns, rows.past, *self._marks(rows),
            self.system.K,
        )  # fmt: skip
        known = self._steps.get(kernel)
        if known is None or not all(map(operator.is_, arrays, known[0])):
            known = self._steps[kernel] = arrays, bound(kernel, *arrays)
        return known[1]

    def exceptions(
        self, rows: Particles, exceptional: NDArray[np.int64], interval: Interval
    ) -> None:
        """Take rows from their birth, or the step's begin, through impacts to the step's end."""
        parts = _parts(exceptional.size, 64)
        impacts = [0] * len(parts)

        def care(k: int) -> None:
            low, high = parts[k]
            impacts[k] = self.system.exceptions(
                rows.position, rows.velocity, rows.birth, rows.columns, exceptional[low:high],
                self.system.K_exact, self.system.K_solid, interval.begin, interval.length,
            )  # fmt: skip

        share(care, len(parts))
        rows.forget(exceptional)
        self.impacts += sum(impacts)

    def rebounds(self, rows: Particles, ends: NDArray[Any], alive: int, interval: Interval) -> bool:
        """Take a group's flight, which leads to `ends` (6, alive), through its impacts.

        Returns whether any row ends elsewhere.
        """
        if self.system.surfaces is None:
            return False
        threats, parts, marks = self.system.staged("threats"), _parts(alive, 1), self._marks(rows)
        held = [NOTHING] * len(parts)

        def threaten(k: int) -> None:
            low, high = parts[k]
            count = threats(
                rows.position, rows.velocity, *marks, self.system.K_staged, ends, interval.begin,
                interval.end, low, high,
            )  # fmt: skip
            held[k] = self.held[low : low + count]

        share(threaten, len(parts))
        threatened = np.concatenate([NOTHING, *held])
        parts = _parts(threatened.size, 64)
        counts = [(0, 0)] * len(parts)

        def care(k: int) -> None:
            low, high = parts[k]
            counts[k] = self.system.rebounds(
                rows.position, rows.velocity, ends, rows.birth, rows.columns, threatened[low:high],
                self.system.K_exact, self.system.K_solid, interval.begin, interval.length,
            )  # fmt: skip

        share(care, len(parts))
        rows.forget(threatened)
        self.impacts += sum(hits for hits, _ in counts)
        return any(changed for _, changed in counts)

    def events(self) -> None:
        """Nothing listens to births, impacts and deaths yet; what will goes here."""

    def deaths(
        self,
        rows: Particles,
        exceptional: NDArray[np.int64],
        interval: Interval,
        caught: NDArray[np.int64] = NOTHING,
    ) -> None:
        """Take out the rows that were caught, and those that a retirement claims; the straight pass
        has marked its own.
        """
        mortal = self.system.motion.mortal
        if not rows.count or not (mortal or caught.size):
            return
        (flags, _), parts = self._marks(rows), _parts(exceptional.size if mortal else 0, 1)
        if not mortal:
            flags[: rows.count] = 0

        def retire(k: int) -> None:
            low, high = parts[k]
            self.system.retire(
                rows.position, rows.velocity, rows.birth, rows.columns, flags, self.system.K,
                interval.end, exceptional[low:high],
            )  # fmt: skip

        share(retire, len(parts))
        flags[caught] = 1
        rows.keep(flags)

    def _marks(self, rows: Particles) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
        """Room for a flag of every row, and for a list of those that may meet a solid."""
        if self.flags.size < rows.capacity:
            self.flags = np.zeros(rows.capacity, np.uint8)
            if self.system.surfaces is not None:
                self.held = np.empty(rows.capacity, np.int64)
        return self.flags, self.held


def _parts(rows: int, cost: int) -> list[tuple[int, int]]:
    """Blocks of rows for the threads; `cost` is what a row costs, in rows of the straight pass.

    The blocks follow from the number of rows alone: the last bits of a row may depend on where in
    a SIMD loop it stands, and must not depend on the number of threads.
    """
    sixteenth = -(-rows * cost // 16)
    return blocks(rows, min(max(sixteenth, SMALLEST_BLOCK), LARGEST_BLOCK) // cost)
