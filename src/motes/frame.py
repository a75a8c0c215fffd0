"""A frame: all particles at one instant, as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from motes.errors import likely

Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Frame:
    """All particles of a scene at one instant of its film.

    `frame["water"]["position"]` is the (n, 3) array of positions [m]. Every system has `position`
    and `velocity` (n, 3) [m, m/s], `color` (n, 4) linear RGBA, `size` (n,) [m], `age` (n,) [s] and
    `id` (n,) uint64, and may have more columns; row i is the same particle in all of them.
    """

    time: float
    """Simulated time [s]."""

    index: int
    """Number of the frame in its film, from 1."""

    systems: Mapping[str, Columns]
    """Columns by name, by system."""

    @property
    def count(self) -> int:
        """Number of particles in all systems."""
        return sum(
            max((len(column) for column in columns.values()), default=0)
            for columns in self.systems.values()
        )

    def __getitem__(self, system: str) -> Columns:
        """The columns of one system."""
        if system not in self.systems:
            menu = ", ".join(self.systems) or "none"
            hint = likely(system, self.systems)
            raise KeyError(f'frame {self.index} has no system "{system}".{hint} It has {menu}.')
        return self.systems[system]
