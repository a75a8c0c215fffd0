"""The classical Runge-Kutta method for x'' = a(x, v), by whole arrays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


def rk4(a: Field, x: np.ndarray, v: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity after a step of length h."""
    k1, l1 = v, a(x, v)
    k2, l2 = v + h / 2 * l1, a(x + h / 2 * k1, v + h / 2 * l1)
    k3, l3 = v + h / 2 * l2, a(x + h / 2 * k2, v + h / 2 * l2)
    k4, l4 = v + h * l3, a(x + h * k3, v + h * l3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), v + h / 6 * (l1 + 2 * l2 + 2 * l3 + l4)
