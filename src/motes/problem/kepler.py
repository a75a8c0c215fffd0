"""A planet on an ellipse of eccentricity 0.5: who keeps the energy, and who the place?"""

import numpy as np

from motes.problem import Array, Problem


def acceleration(t: float, x: Array, v: Array) -> tuple[float, float]:
    """Gravity, GM = 1."""
    cube = (x[0] * x[0] + x[1] * x[1]) ** 1.5
    return -x[0] / cube, -x[1] / cube


problem = Problem(
    acceleration=acceleration,
    start=(0.5, 0.0, 0.0, np.sqrt(3.0)),
    span=(0.0, 6 * np.pi),
    step=0.05,
    methods=("euler", "semi_implicit_euler", "leapfrog", "yoshida4", "rk4"),
    energy=lambda y: (y[:, 2:] ** 2).sum(-1) / 2 - 1 / np.hypot(y[:, 0], y[:, 1]),
)
