"""The perspective camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera in a world with z up.

    A point at (X, Y, Z) along right, up and forward falls on the pixel
    x = w/2 + f X/Z, y = h/2 - f Y/Z, with f = h / (2 tan(field_of_view / 2)).
    """

    position: Vector = (0.0, -6.0, 2.0)
    """Centre of projection [m]."""

    look_at: Vector = (0.0, 0.0, 1.0)
    """Point in the middle of the picture [m]."""

    up: Vector = (0.0, 0.0, 1.0)
    """Direction that is upright in the picture."""

    field_of_view: float = 40.0
    """Vertical angle of the picture [degrees], above 0 and below 180."""

    near: float = 0.05
    """Nothing nearer than this along the axis is drawn [m]."""

    close: Camera | None = None
    """The camera when the shutter closes; its motion draws streaks. None: it stands still."""

    def __post_init__(self) -> None:
        if not 0.0 < self.field_of_view < 180.0:
            raise ValueError(f"field_of_view must be in (0, 180) degrees, not {self.field_of_view}")
        if not self.near > 0.0:
            raise ValueError(f"near must be above 0 m, not {self.near}")

    def axes(self) -> NDArray[np.float64]:
        """Right, up and forward as the rows of a rotation (3, 3).

        Where the view is along `up`, or `look_at` is the position, any upright direction serves.
        """
        return _axes(self.position, self.look_at, self.up)

    def view(self) -> NDArray[np.float32]:
        """World to camera coordinates, (3, 4): rows right, up, forward; the last column shifts."""
        axes = self.axes()
        shift = -axes @ np.asarray(self.position, float)
        return np.column_stack([axes, shift]).astype(np.float32)

    def focal(self, height: int) -> float:
        """Pixels per unit of slope, f = h / (2 tan(field_of_view / 2)), for a picture's height."""
        return height / (2.0 * float(np.tan(np.radians(self.field_of_view) / 2.0)))

    def rays(
        self, x: NDArray[np.floating], y: NDArray[np.floating], size: tuple[int, int]
    ) -> NDArray[np.float32]:
        """Unit directions in the world through the points x, y [pixels] of a picture, (n, 3)."""
        f = self.focal(size[1])
        slopes = np.ones((len(x), 3), np.float32)
        slopes[:, 0] = (x - size[0] / 2.0) / f
        slopes[:, 1] = (size[1] / 2.0 - y) / f
        slopes /= np.sqrt(np.einsum("ik,ik->i", slopes, slopes))[:, None]
        rays: NDArray[np.float32] = slopes @ self.axes().astype(np.float32)
        return rays


@lru_cache(maxsize=8)
def _axes(position: Vector, look_at: Vector, up: Vector) -> NDArray[np.float64]:
    forward = _unit(np.subtract(look_at, position), (0.0, 1.0, 0.0))
    fallback = np.eye(3)[np.argmin(np.abs(forward))]
    side = np.cross(forward, _unit(np.asarray(up, float), (0.0, 0.0, 1.0)))
    right = _unit(side, _unit(np.cross(forward, fallback), (1.0, 0.0, 0.0)))
    axes = np.stack([right, np.cross(right, forward), forward])
    axes.flags.writeable = False
    return axes


def _unit(
    vector: NDArray[np.float64], otherwise: Vector | NDArray[np.float64]
) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    if not 1e-9 < length < np.inf:
        return np.asarray(otherwise, float)
    return vector / length
