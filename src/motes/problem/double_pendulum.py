"""Two equal pendulums, one below the other: chaos that keeps its energy."""

import numpy as np

from motes.problem import Array, Problem

GRAVITY = 9.81


def slope(t: float, y: Array) -> tuple[float, float, float, float]:
    """Angles a, b and their speeds; unit masses and lengths."""
    a, b, u, w = y[0], y[1], y[2], y[3]
    c, s = np.cos(a - b), np.sin(a - b)
    below = 2 - c * c
    up = -GRAVITY * (2 * np.sin(a) - c * np.sin(b)) - s * (w * w + c * u * u)
    down = GRAVITY * (2 * c * np.sin(a) - 2 * np.sin(b)) + s * (2 * u * u + c * w * w)
    return u, w, up / below, down / below


def energy(y: Array) -> Array:
    """Kinetic and potential energy."""
    a, b, u, w = y.T
    moving = u * u + w * w / 2 + u * w * np.cos(a - b)
    total: Array = moving - GRAVITY * (2 * np.cos(a) + np.cos(b))
    return total


problem = Problem(
    slope=slope,
    start=(2.0, 2.5, 0.0, 0.0),
    span=(0.0, 4.0),
    step=0.02,
    methods=("euler", "midpoint", "rk4", "tsit5", "dop853"),
    labels=("upper angle", "lower angle"),
    energy=energy,
)
