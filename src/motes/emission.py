"""When particles are born: the k-th birth happens when the integral of the rate reaches k.

The births of a step follow from its two ends alone, so that none is lost or doubled however a run
is cut into steps, and an emitter has no state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.control.constant import Constant
from motes.control.curve import Curve
from motes.control.spline import Spline
from motes.memory import afford
from motes.philox import address, birth_number

BIRTH = 40
"""Bytes that a birth takes until it is a row: its number twice, its instant, and copies."""


@dataclass(frozen=True)
class Source:
    """One stream of births with an address of its own, on which ids hang."""

    address: int
    numbers: NDArray[np.uint64]
    times: NDArray[np.float64]


@dataclass(frozen=True)
class Clock:
    """The birth instants of one emitter. `start` is the time [s] at which the scene begins."""

    name: str
    emitter: Component
    start: float

    @property
    def opens(self) -> float:
        """Time of the first possible birth."""
        return self.start + float(self.emitter.values["delay"].value)  # type: ignore[attr-defined]

    @property
    def closes(self) -> float:
        """Time after which none is born."""
        return self.opens + float(self.emitter.values["duration"].value)  # type: ignore[attr-defined]

    @cached_property
    def _number(self) -> int:
        return address(self.name)

    @cached_property
    def _bursts(self) -> list[tuple[float, int, int]]:
        """Time, count and address of every single burst, in order of time."""
        found = []
        for j, burst in enumerate(self.emitter.values["burst"].value):  # type: ignore[attr-defined]
            for n in range(int(burst["times"])):
                time = self.opens + burst["at"] + n * burst["every"]
                if time <= self.closes:
                    found.append((time, int(burst["count"]), address(f"{self.name}#{j}.{n}")))
        return sorted(found)

    def sources(self, begin: float, end: float) -> list[Source]:
        """Births in begin < t <= end (and at the very start, in the first step).

        Raises:
            MemoryBudgetError: they are more than fit into memory.
        """
        result = []
        first = begin <= self.start
        for time, count, number in self._bursts:
            if begin < time <= end or (first and time <= begin):
                self._afford(count)
                numbers = np.arange(1, count + 1, dtype=np.uint64)
                result.append(Source(number, numbers, np.full(count, max(time, begin))))
        low, high = self._integral(begin), self._integral(end)
        self._afford(high - low)
        k = np.arange(np.floor(low) + 1, np.floor(high) + 1)
        if k.size:
            times = np.clip(self._when(k), begin, end)
            result.append(Source(self._number, k.astype(np.uint64), times))
        return result

    def _afford(self, births: float) -> None:
        afford(int(births) * BIRTH, f'emitter "{self.name}": {births:.3g} births in one step')

    def silent(self, begin: float, end: float) -> bool:
        """Whether `sources` gives none."""
        first = begin <= self.start
        for time, _, _ in self._bursts:
            if begin < time <= end or (first and time <= begin):
                return False
        return bool(np.floor(self._integral(begin)) == np.floor(self._integral(end)))

    def numbers(self, ids: NDArray[np.uint64], time: float) -> NDArray[np.int64]:
        """Which births particles are (2, n): number of the stream and k, -1 for other emitters'.

        The streams are the bursts, in order of time, and then the births of the rate.
        """
        found: NDArray[np.int64] = np.full((2, ids.size), -1)
        streams = [(number, count) for _, count, number in self._bursts]
        streams.append((self._number, int(self._integral(time)) + 1))
        for k, (number, count) in enumerate(streams):
            births = birth_number(number, ids)
            own = (births >= 1) & (births <= count)
            found[0, own], found[1, own] = k, births[own].astype(np.int64)
        return found

    def expected(self, begin: float, end: float) -> float:
        """Number of births between two times, before it is made."""
        bursts = sum(count for time, count, _ in self._bursts if begin < time <= end)
        return self._integral(end) - self._integral(begin) + bursts

    @cached_property
    def _rate(self) -> float | Spline:
        """The rate, on a time that counts from the opening."""
        rate = self.emitter.values["rate"]
        if isinstance(rate, Constant):
            return float(rate.values[0])
        assert isinstance(rate, Curve)
        return replace(rate.spline, times=rate.spline.times - self.opens)

    def _integral(self, time: float) -> float:
        """Integral of the rate from the opening to a time."""
        since = min(max(time, self.opens), self.closes) - self.opens
        rate = self._rate
        return rate * since if isinstance(rate, float) else float(rate.integral(since))

    def _when(self, k: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times at which the integral reaches k."""
        rate = self._rate
        return self.opens + (k / rate if isinstance(rate, float) else np.asarray(rate.when(k)))
