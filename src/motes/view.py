"""A read-only look at the particles of one system, by column name."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.appearance import Look
from motes.compile.system import CompiledSystem
from motes.errors import likely
from motes.state import Particles

DRAWN = ("position", "velocity", "color", "size", "id", "age")
"""Columns that a frame keeps."""


class View:
    """Columns of one system at one instant; arrays of numbers that must not be written to.

    `position` and `velocity` are (n, 3) [m, m/s]; `id` (n,) uint64; `age` and `birth` (n,) [s];
    `life` [s], `mass` [kg], `size` [m] (n,); `color` (n, 4) linear; and every other value drawn at
    birth by its address.
    """

    def __init__(
        self, particles: Particles, system: CompiledSystem, look: Look, time: float
    ) -> None:
        self._particles, self._system, self._look, self._time = particles, system, look, time

    def __len__(self) -> int:
        return self._particles.count

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        drawn = [c.shown or c.address for c in self._system.columns]
        fixed = ("position", "velocity", "id", "age", "birth", *self._look.names)
        return tuple(dict.fromkeys([*fixed, *drawn]))

    def __getattr__(self, name: str) -> NDArray[Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        return self[name]

    def __getitem__(self, name: str) -> NDArray[Any]:
        array = self._column(name)
        array.flags.writeable = False
        return array

    def _column(self, name: str) -> NDArray[Any]:
        p, n = self._particles, self._particles.count
        if name == "position":
            return p.position[:, :n].T
        if name == "velocity":
            return p.velocity[:, :n].T if p.moves else self._carried()
        if name == "id":
            return p.ids[:n]
        if name == "birth":
            return p.birth[:n]
        if name == "age":
            return self._time - p.birth[:n]
        start = 0
        for column in self._system.columns:
            if name in (column.shown or column.address, column.address):
                parts = [p.columns[start + i][:n] for i in range(column.width)]
                return parts[0] if column.width == 1 else np.stack(parts, axis=1)
            start += column.width
        if name in self._look.names:
            return self._look.value(name, self)
        raise AttributeError(
            f'system "{p.name}" has no column "{name}".{likely(name, self.columns)} '
            f"It has {', '.join(self.columns)}."
        )

    @property
    def time(self) -> float:
        """Scene time [s] of this view."""
        return self._time

    def _carried(self) -> NDArray[Any]:
        """Velocity that the flows give, for systems without one of their own."""
        return self._system.carried(self._particles, self._time)

    def drawn(self) -> dict[str, NDArray[Any]]:
        """The columns that a frame keeps, as independent arrays of plain precision."""
        result = {}
        for name in DRAWN:
            dtype = np.uint64 if name == "id" else np.float32
            result[name] = np.array(self._column(name), dtype, order="C")
        return result
