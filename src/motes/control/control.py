"""What every control is: a value that may vary, with its scope and its form in a document."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


class Control(ABC):
    """A number, vector or colour that may vary.

    `scope` says how much: "scene" (one value for all particles at an instant), "birth" (drawn once
    for each particle) or "particle" (changes during its life). `width` is the count of components.
    """

    scope: str
    width: int

    @abstractmethod
    def document(self) -> Any:
        """The control as it stands in a scene file."""

    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest value that any component can take."""

    def at(self, time: float) -> Values:
        """Value at a scene time [s], shape (width,), for controls of scene scope."""
        raise TypeError(f"a control of scope {self.scope} has no value of its own at a time")

    def __eq__(self, other: object) -> bool:
        return (
            type(self) is type(other)
            and isinstance(other, Control)
            and self.document() == other.document()
        )

    def __hash__(self) -> int:
        return hash((type(self), self.width))

    def __repr__(self) -> str:
        return repr(self.document())
