"""Captures: who is caught by whom at a step's end; the caught die in the deaths phase.

Laws that define `captures(p, hunters, prey)` see positions at the step's end. All captures of a
simulation are kept: instant, place, and both ids.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.state import Particles

CAPTURE = np.dtype(
    [("time", float), ("hunter", np.uint64), ("prey", np.uint64), ("place", float, 3)]
)
"""One capture: scene time [s], ids of both, and where [m]."""


class Animals(NamedTuple):
    """Particles of one system as a law of captures sees them."""

    name: str
    position: NDArray[Any]
    """(3, n) at the step's end [m]"""


class Captures:
    """The laws of captures of one group, and what they have caught."""

    def __init__(self, laws: Sequence[tuple[str, Component]]) -> None:
        self.laws = tuple(laws)
        self.caught: dict[str, NDArray[np.int64]] = {}
        """Rows caught in the last step, by system."""
        self.kept: list[NDArray[Any]] = []
        """All captures so far, step by step, each sorted by the id of the prey."""

    def rows(self, name: str) -> NDArray[np.int64]:
        """Rows of a system that were caught in the step."""
        return self.caught.get(name, np.zeros(0, np.int64))

    def find(
        self,
        systems: Mapping[str, Particles],
        end: float,
        alive: Mapping[str, int],
        values: Callable[[Component, float], Any],
    ) -> None:
        """Find who is caught at a step's end [s]; of several laws the first in order has it."""
        self.caught = {}
        for _, law in self.laws:
            animals = {
                name: Animals(name, systems[name].position[:, :n]) for name, n in alive.items()
            }
            named, hunting = (law.values[key].document() for key in ("systems", "hunters"))
            hunters = [a for name, a in animals.items() if name in hunting]
            prey = [
                a for name, a in animals.items()
                if name not in hunting and (not named or name in named)
            ]  # fmt: skip
            captures = type(law).kernel("captures")
            assert captures is not None
            for hunter, i, victim, j in captures(values(law, end), hunters, prey):
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
