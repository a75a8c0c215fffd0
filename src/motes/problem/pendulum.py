"""A pendulum from almost upright: closed curves in the plane of angle and speed."""

import numpy as np

from motes.problem import Array, Problem


def acceleration(t: float, x: Array, v: Array) -> tuple[float]:
    """Gravity along the arc."""
    return (-np.sin(x[0]),)


problem = Problem(
    acceleration=acceleration,
    start=(2.8, 0.0),
    span=(0.0, 25.0),
    step=0.2,
    methods=("euler", "semi_implicit_euler", "leapfrog", "rk4", "implicit_midpoint"),
    labels=("angle", "speed"),
    energy=lambda y: y[:, 1] ** 2 / 2 - np.cos(y[:, 0]),
)
