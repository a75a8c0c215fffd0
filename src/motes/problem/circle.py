"""The rotational field (-y, x): Euler spirals outward by √(1 + h²) each step, for any h."""

import numpy as np

from motes.problem import Array, Problem


def slope(t: float, y: Array) -> tuple[float, float]:
    """A quarter turn of the place."""
    return -y[1], y[0]


problem = Problem(
    slope=slope,
    start=(1.0, 0.0),
    span=(0.0, 2 * np.pi),
    step=0.25,
    methods=("euler", "midpoint", "rk4", "backward_euler", "implicit_midpoint"),
    exact=lambda t: np.column_stack([np.cos(t), np.sin(t)]),
    energy=lambda y: (y**2).sum(-1) / 2,
)
