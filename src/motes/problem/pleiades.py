"""Seven stars in a plane with near encounters: a test of step control.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10.
"""

import numpy as np

from motes.problem import Array, Problem

MASS = np.arange(1.0, 8.0)


def acceleration(t: float, x: Array, v: Array) -> Array:
    """Gravity, G = 1; x holds seven abscissae, then seven ordinates."""
    pull = np.zeros(14)
    for i in range(7):
        for j in range(i):
            dx, dy = x[j] - x[i], x[7 + j] - x[7 + i]
            share = 1.0 / (dx * dx + dy * dy) ** 1.5
            pull[i] += MASS[j] * share * dx
            pull[7 + i] += MASS[j] * share * dy
            pull[j] -= MASS[i] * share * dx
            pull[7 + j] -= MASS[i] * share * dy
    return pull


problem = Problem(
    acceleration=acceleration,
    start=(
        *(3.0, 3.0, -1.0, -3.0, 2.0, -2.0, 2.0, 3.0, -3.0, 2.0, 0.0, 0.0, -4.0, 4.0),
        *(0.0, 0.0, 0.0, 0.0, 0.0, 1.75, -1.5, 0.0, 0.0, 0.0, -1.25, 1.0, 0.0, 0.0),
    ),
    span=(0.0, 3.0),
    step=0.002,
    methods=("leapfrog", "yoshida4", "rk4", "dopri5", "dop853"),
    axes=tuple((i, 7 + i) for i in range(7)),
)
