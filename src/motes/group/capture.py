"""Captures: who is caught by whom at a step's end; the caught die in the deaths phase.

Laws that define `captures(p, hunters, prey, luck, step)` see positions at the step's end;
`luck(hunter ids, prey ids)` gives a number in [0, 1) for each pair of ids. All captures of a
simulation are kept: instant, place, and both ids.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.errors import SceneError
from motes.group.partners import Interactions, named
from motes.jit import EXACT, jit
from motes.philox import channel, draw, uniform_double
from motes.state import Particles

CAPTURE = np.dtype(
    [("time", float), ("hunter", np.uint64), ("prey", np.uint64), ("place", float, 3)]
)
"""One capture: scene time [s], ids of both, and where [m]."""


NOBODY: NDArray[np.int64] = np.zeros(0, np.int64)
"""No rows."""


class Animals(NamedTuple):
    """Particles of one system as a law of captures sees them."""

    name: str
    position: NDArray[Any]
    """(3, n) at the step's end [m]"""
    ids: NDArray[np.uint64]
    """(n,)"""


class Captures:
    """The laws of captures of one group, and what they have caught."""

    def __init__(self, laws: Interactions, systems: Iterable[str]) -> None:
        self.laws = laws
        for _, law in laws:
            if not law.values["hunters"].document():
                raise SceneError(f'interaction "{law.name}": hunters must name who catches.')
            named(law, "hunters", systems)
        self.caught: dict[str, NDArray[np.int64]] = {}
        """Rows caught in the last step, by system."""
        self.kept: list[NDArray[Any]] = []
        """All captures so far, step by step, each sorted by the id of the prey."""

    def rows(self, name: str) -> NDArray[np.int64]:
        """Rows of a system that were caught in the step."""
        return self.caught.get(name, NOBODY)

    def find(
        self,
        systems: Mapping[str, Particles],
        interval: tuple[float, float],
        seed: np.uint64,
        alive: Mapping[str, int],
        values: Callable[[Component, float], Any],
    ) -> None:
        """Find who is caught at the end of an interval [s]; of several laws the first has it."""
        if not self.laws:
            return
        self.caught = {}
        begin, end = interval
        animals = {
            name: Animals(name, systems[name].position[:, :n], systems[name].ids[:n])
            for name, n in alive.items()
        }
        for address, law in self.laws:

            def luck(
                hunter: NDArray[Any], prey: NDArray[Any], channel: int = channel(address)
            ) -> NDArray[Any]:
                drawn = np.empty(len(hunter))
                tick = np.array([begin]).view(np.uint32)
                _draw(seed, hunter, prey, np.uint32(channel), tick[0] ^ tick[1], drawn)
                return drawn

            named, hunting = (law.values[key].document() for key in ("systems", "hunters"))
            hunters = [a for name, a in animals.items() if name in hunting]
            prey = [
                a for name, a in animals.items()
                if name not in hunting and (not named or name in named)
            ]  # fmt: skip
            captures = type(law).kernel("captures")
            assert captures is not None
            for hunter, i, victim, j in captures(
                values(law, end), hunters, prey, luck, end - begin
            ):
                self._note(systems, end, hunter, i, victim, j)

    def _note(
        self, systems: Mapping[str, Particles], end: float,
        hunter: str, i: NDArray[Any], victim: str, j: NDArray[Any],
    ) -> None:  # fmt: skip
        known = self.rows(victim)
        fresh = ~np.isin(j, known)
        i, j = i[fresh], j[fresh]
        if not j.size:
            return
        self.caught[victim] = np.union1d(known, j)
        found = np.empty(j.size, CAPTURE)
        found["time"], found["hunter"] = end, systems[hunter].ids[i]
        found["prey"], found["place"] = systems[victim].ids[j], systems[victim].position[:, j].T
        self.kept.append(np.sort(found, order="prey"))


@jit(flags=EXACT)
def _draw(seed: Any, hunter: Any, prey: Any, channel: Any, tick: Any, out: Any) -> None:
    """Uniform numbers that follow from two particles, the law and the instant."""
    for i in range(out.size):
        pair = hunter[i] ^ (prey[i] * np.uint64(0x9E3779B97F4A7C15))
        a, b, _, _ = draw(seed, pair, channel, tick)
        out[i] = uniform_double(a, b)
