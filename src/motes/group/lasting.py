"""What a group keeps from step to step: lists, trees, and what was last summed up."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.pairs import Law
from motes.compile.text import AXES
from motes.control.curve import Curve
from motes.interact.arrange import Arranged, Box
from motes.interact.clusters import Clusters
from motes.jit import Calls
from motes.state import Particles
from motes.step import Stepper

Kept = dict[str, tuple[int, int]]
"""Rows and deaths by system: as long as they are the same, so are the particles."""

CAUTION = 1 - 2.0**-10
"""Share of the allowed way after which a list is stale: more than rounding takes away."""


SHORT = 0.36
"""Margin of the lists of particles as a share of that of the lists of clusters."""


@dataclass
class Body:
    """One system of a group at one stage."""

    stepper: Stepper
    rows: Particles
    alive: int
    motion: NDArray[Any]
    """(6, at least n) positions and velocities [m, m/s]."""
    time: float = 0.0

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.rows.name

    @property
    def position(self) -> NDArray[Any]:
        """Positions (3, n) [m]."""
        return self.motion[:3, : self.alive]

    @property
    def velocity(self) -> NDArray[Any]:
        """Velocities (3, n) [m/s]."""
        return self.motion[3:, : self.alive]

    @property
    def mass(self) -> NDArray[Any]:
        """Masses (n,) [kg]."""
        return self.stepper.mass(self.rows, self.alive)

    def lasts(self, name: str) -> bool:
        """Whether a number of every particle never changes."""
        traits = self.stepper.system.motion.traits
        return name in traits and not isinstance(traits[name][1], Curve)

    def column(self, name: str) -> NDArray[Any]:
        """A number of every particle: v and an axis, or a trait."""
        if name in ("vx", "vy", "vz"):
            axis: NDArray[Any] = self.velocity["xyz".index(name[1])]
            return axis
        return self.stepper.trait(name, self.rows, self.alive, self.time)


@dataclass(frozen=True)
class Lists:
    """The neighbour lists of laws that share them."""

    radius: float
    """What is within it is listed [m]."""
    arranged: dict[str, Arranged]
    near: dict[tuple[str, str], list[Clusters]]
    """Lists of clusters by target and source."""
    kept: Kept
    """Rows and deaths for which they hold."""
    step: int = 0
    """Number of the step in which they were built."""
    columns: dict[tuple[str, str], NDArray[Any]] = field(default_factory=dict)
    """What does not change while they hold, by system and name, in the order of slots."""
    short: dict[tuple[str, str], Calls] = field(default_factory=dict)
    """Lists of particles by target and source: parts that loops over them are called with."""
    short_radius: float = 0.0
    """What was within it when they were chosen is in them [m]."""
    marks: dict[str, NDArray[Any]] = field(default_factory=dict)
    """Where particles (n, 4) were then [m]."""
    settled: bool = False
    """Whether rows are in the order of cells."""


@dataclass
class Lasting:
    """What a group keeps from step to step: lists, and what was last summed up."""

    lists: list[Lists | None] = field(default_factory=list)
    push: dict[str, NDArray[Any]] | None = None
    """Accelerations (3, n) of all systems at `time`, while nothing has moved since."""
    pushes: dict[str, NDArray[Any]] = field(default_factory=dict)
    """Where they are written."""
    time: float = 0.0
    kept: Kept = field(default_factory=dict)
    builds: int = 0
    """How often lists were built."""
    untidy: set[str] = field(default_factory=set)
    """Systems whose rows are scattered, to be moved before the next step."""
    steps: int = 0
    """How many steps were begun."""
    trees: dict[Any, Any] = field(default_factory=dict)
    """`motes.gravity.Trees` of sums over all pairs, by what is summed."""
    rooms: dict[Any, Any] = field(default_factory=dict)
    """Memory of lists that nobody else holds: those that replace them may be written there."""

    def copy(self) -> Lasting:
        """A copy with its own pushes; it shares the arrays of lists, which are replaced and not
        written to from now on."""
        self.rooms = {}
        push = self.push and {name: array.copy() for name, array in self.push.items()}
        return replace(
            self,
            lists=list(self.lists),
            untidy=set(self.untidy),
            trees={kind: trees.copy() for kind, trees in self.trees.items()},
            rooms={},
            push=push,
            pushes={},
        )

    def pushed(self, name: str, alive: int, real: Any) -> NDArray[Any]:
        """Room for a system's accelerations (3, alive), filled with 0."""
        room = self.pushes.get(name)
        if room is None or room.shape[1] != alive:
            room = self.pushes[name] = np.empty((3, alive), real)
        room.fill(0)
        return room

    def arrays(self) -> Iterator[NDArray[Any]]:
        """Everything that can change the next bit."""
        yield np.array([self.builds])
        for part in self.lists:
            for arranged in part.arranged.values() if part else ():
                yield from (arranged.order, arranged.real.position)
            yield from part.marks.values() if part else ()
        for trees in self.trees.values():
            yield from trees.arrays()
        yield from (self.push or {}).values()


@dataclass
class Class:
    """Laws that share lists, with the systems that each acts on and feels."""

    laws: list[tuple[Law, tuple[str, ...], tuple[str, ...]]]

    @cached_property
    def pairs(self) -> list[tuple[str, str]]:
        """Targets and sources for which lists are needed."""
        found = {(a, b) for _, targets, sources in self.laws for a in targets for b in sources}
        return sorted(found)

    @cached_property
    def systems(self) -> list[str]:
        """Systems that take part."""
        return sorted({name for pair in self.pairs for name in pair})

    @cached_property
    def fields(self) -> dict[str, list[str]]:
        """What is read of every system besides its places."""
        wanted: dict[str, set[str]] = {name: set() for name in self.systems}
        for law, targets, sources in self.laws:
            for names, fields in zip((targets, sources), law.fields, strict=True):
                for name in names:
                    wanted[name] |= set(fields)
        return {name: sorted(fields - set(AXES)) for name, fields in wanted.items()}

    @cached_property
    def every(self) -> int:
        """Steps between builds of lists, 0 where they follow from how far particles go."""
        return min(law.rebuild for law, _, _ in self.laws)

    def reach(self, time: float) -> float:
        """The longest reach at a time [m]."""
        return max(law.reach(time) for law, _, _ in self.laws)

    def radius(self, time: float, periodic: Box) -> float:
        """Radius of lists that are built at a time [m]."""
        wanted = max(
            law.reach(time) * (1 + float(law.values(time)["skin"])) for law, _, _ in self.laws
        )
        return min(wanted, 0.999 * periodic.shortest)

    def good(self, found: Lists, moved: float, time: float, step: int) -> bool:
        """Whether lists of particles miss no pair after these have moved [m], or last longer."""
        if not found.short or not math.isfinite(moved):
            return False
        if self.every:
            return step - found.step < self.every
        return 2 * moved <= self.margin(found, time)

    def margin(self, found: Lists, time: float) -> float:
        """Ways [m] of two particles, together, up to which lists of particles miss no pair."""
        return (found.short_radius - self.reach(time)) * CAUTION

    def short_radius(self, found: Lists, moved: float, time: float) -> float:
        """Radius for lists of particles that are chosen now, after a way [m] since the build.

        No wider than what all pairs within it are listed for; 0 where it is not worth while.
        """
        reach = self.reach(time)
        if self.every or not math.isfinite(moved):
            return 0.0
        margin = SHORT * (found.radius - reach)
        room = (found.radius - 2 * moved) * CAUTION - reach
        return reach + min(margin, room) if room > margin / 2 > 0 else 0.0
