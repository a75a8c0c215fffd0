"""Particles as the renderer sees them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

Kind = Literal["points", "streaks", "sprites"]


@dataclass(frozen=True, eq=False)
class Layer:
    """Particles that are drawn alike.

    Each is a round splat parallel to the picture with the weight w = (1 - r^2/R^2)^3, 1 in its
    centre. It adds the light color emission alpha w, hides alpha opacity w of what is behind it,
    and scatters color light on what it hides.

    Raises:
        ValueError: an array has the wrong shape, or the kind is unknown.
    """

    position: NDArray[np.float32]
    """(n, 3) at the opening of the shutter [m]."""

    velocity: NDArray[np.float32]
    """(n, 3) [m/s]; only streaks use it."""

    color: NDArray[np.float32]
    """(n, 4) linear red, green, blue and alpha."""

    size: NDArray[np.float32]
    """(n,) diameter [m]."""

    kind: Kind = "points"
    """points and sprites stand still; streaks are the average over the way from x - v trail to
    x + v shutter."""

    emission: float = 1.0
    """Radiance of the centre per color; 0 for matter that only scatters."""

    opacity: float = 0.0
    """Part of the light behind the centre that is hidden, times alpha; 0 for pure light."""

    softness: float = 0.0
    """Depth over which a particle fades in front of a solid instead of being cut [m]."""

    shutter: NDArray[np.float32] | None = None
    """(n, 2) part of the shutter interval in which the particle exists, 0 to 1; None: all of it."""

    trail: float = 0.0
    """Time before the opening of the shutter whose way a streak shows too [s]."""

    age: NDArray[np.float32] | None = None
    """(n,) time since birth [s], before which no trail reaches; None: long ago."""

    def __post_init__(self) -> None:
        n = len(self.position)
        shapes = {"position": (n, 3), "velocity": (n, 3), "color": (n, 4), "size": (n,)}
        if self.shutter is not None:
            shapes["shutter"] = (n, 2)
        if self.age is not None:
            shapes["age"] = (n,)
        for name, shape in shapes.items():
            array: Any = np.ascontiguousarray(getattr(self, name), np.float32)
            if array.shape != shape:
                raise ValueError(f"{name} must have the shape {shape}, not {array.shape}")
            object.__setattr__(self, name, array)
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}, not {self.kind}")

    def __len__(self) -> int:
        return len(self.size)
