"""Stiff decay x' = -k x + k cos t: explicit methods explode where h k exceeds a small number."""

import numpy as np

from motes.problem import Array, Problem

RATE = 50.0


def slope(t: float, y: Array) -> tuple[float, float]:
    """y holds x and the time."""
    return -RATE * (y[0] - np.cos(y[1])), 1.0


def exact(t: Array) -> Array:
    """The slow part, and what is left of the start."""
    share = RATE / (1 + RATE**2)
    slow = share * (RATE * np.cos(t) + np.sin(t))
    return np.column_stack([slow + (0.2 - share * RATE) * np.exp(-RATE * t), t])


problem = Problem(
    slope=slope,
    start=(0.2, 0.0),
    span=(0.0, 2.0),
    step=0.041,
    methods=("euler", "rk4", "backward_euler", "trapezoid", "sdirk2"),
    axes=((1, 0),),
    labels=("t", "x"),
    exact=exact,
)
