"""Seven stars in a plane with near encounters: a test of step control.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.10.
"""

import numpy as np

from motes.problem import Array, Problem

MASS = np.arange(1.0, 8.0)


def acceleration(t: float, x: Array, v: Array) -> Array:
    """Gravity, G = 1; x holds seven abscissae, then seven ordinates."""
    p = x.reshape(2, 7)
    d = p[:, None, :] - p[:, :, None]
    r = np.sqrt((d**2).sum(0)) + np.eye(7)
    pull: Array = (MASS * d / r**3).sum(-1)
    return pull.reshape(-1)


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
