"""A value that does not vary."""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.control.control import Control, Values


class Constant(Control):
    """One number, vector or colour for all particles and all times."""

    scope = "scene"

    def __init__(self, values: Values, document: Any) -> None:
        self.values = np.atleast_1d(np.asarray(values, float))
        self.width = self.values.size
        self._document = document

    def document(self) -> Any:
        """The plain value."""
        return self._document

    def bounds(self) -> tuple[float, float]:
        """Smallest and largest component."""
        return float(self.values.min()), float(self.values.max())

    def at(self, time: float) -> Values:
        """The value."""
        return self.values

    def __eq__(self, other: object) -> bool:
        """Whether the numbers are equal, however they are written: 1 is 1.0."""
        return isinstance(other, Constant) and self.values.tolist() == other.values.tolist()

    def __hash__(self) -> int:
        return hash(tuple(self.values.tolist()))


class Setting(Control):
    """A choice, flag or table: a value that shapes the machine code and cannot vary."""

    scope = "fixed"
    width = 1

    def __init__(self, value: Any) -> None:
        self.value = value

    def document(self) -> Any:
        """The plain value."""
        return self.value

    def bounds(self) -> tuple[float, float]:
        """A setting has no range."""
        return 0.0, 0.0
