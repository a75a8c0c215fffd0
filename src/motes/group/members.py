"""Who takes part in a group's step, as its methods, interactions and exchanges see them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.group.contacts import Planes
from motes.group.lasting import Body
from motes.interact.arrange import Box
from motes.jit import BRIEF, even_blocks
from motes.repeat import Repeat, Repeats
from motes.state import Particles
from motes.step import Stepper


@dataclass(frozen=True)
class Bodies:
    """What an interaction sees of one system: `position` (3, n) [m] and `mass` (n,) [kg]."""

    name: str
    position: NDArray[Any]
    mass: NDArray[Any]
    births: Callable[[], NDArray[np.int64]] = lambda: np.zeros((2, 0), np.int64)
    """Gives which births they are (2, n): number of the stream of births, and k from 1 on."""
    kept: dict[Any, Any] = field(default_factory=dict)
    """What interactions keep from one sum to the next, while there are the same particles."""


@dataclass(frozen=True)
class Movers:
    """What an exchange sees of one system and may change: its rows' positions and velocities."""

    name: str
    position: NDArray[Any]
    """(3, n) [m]"""
    velocity: NDArray[Any]
    """(3, n) [m/s]"""
    mass: NDArray[Any]
    """(n,) [kg]"""
    size: NDArray[Any]
    """(n,) diameters [m]"""
    ids: NDArray[np.uint64]


@dataclass(frozen=True)
class Occasion:
    """When an exchange happens: at the end of a step of a length [s], in a box, at an address."""

    length: float
    step: int
    address: str
    seed: int
    periodic: Box
    planes: Callable[[NDArray[Any], float], Planes]
    """Solids that collide within a reach [m] of positions (3, n) [m], as planes."""


@dataclass
class Member:
    """One system of the group during a step: state y (6, capacity) and push (3, n)."""

    stepper: Stepper
    rows: Particles
    alive: int
    y: NDArray[Any]
    """The particles' own positions and velocities, or a copy where a flight has to be kept."""
    push: NDArray[Any]

    def __post_init__(self) -> None:
        self._calls, self._parts = Repeats(), even_blocks(self.alive)
        self._motion = self.rows.motion

    def fits(self, rows: Particles, alive: int) -> bool:
        """Whether it is about these rows, in the same arrays."""
        return self.rows is rows and self.alive == alive and self._motion is rows.motion

    def each(self, name: str, *arguments: Any, numbers: Sequence[float]) -> None:
        """Run one of the system's staged kernels over all rows that were alive."""
        self.calls(name, *arguments)(*numbers)

    def calls(self, name: str, *arguments: Any) -> Repeat:
        """The calls of one of the system's staged kernels for all rows that were alive."""
        kernel, rows = self.stepper.system.staged(name), self.rows
        head = self.y, rows.birth, rows.columns, self.push, *arguments
        return self._calls(name, kernel, head, self._parts, self.alive <= BRIEF)

    def body(self, time: float) -> Body:
        """The system as laws of limited reach see it."""
        return Body(self.stepper, self.rows, self.alive, self.y, time)

    @property
    def K(self) -> Any:
        """What the system's kernels read."""
        return self.stepper.system.K_staged
