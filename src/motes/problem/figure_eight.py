"""Three bodies that chase each other along an eight (Chenciner and Montgomery, 2000)."""

import numpy as np

from motes.problem import Array, Problem

FIRST, LAST = (0.97000436, -0.24308753), (-0.93240737, -0.86473146)
HALF = (-LAST[0] / 2, -LAST[1] / 2)


def acceleration(t: float, x: Array, v: Array) -> Array:
    """Gravity of unit masses, G = 1."""
    pull = np.zeros(6)
    for i in range(3):
        for j in range(i):
            dx, dy = x[2 * j] - x[2 * i], x[2 * j + 1] - x[2 * i + 1]
            share = 1.0 / (dx * dx + dy * dy) ** 1.5
            pull[2 * i] += share * dx
            pull[2 * i + 1] += share * dy
            pull[2 * j] -= share * dx
            pull[2 * j + 1] -= share * dy
    return pull


def energy(y: Array) -> Array:
    """Kinetic energy, and that of the three pairs."""
    p = y[:, :6].reshape(-1, 3, 2)
    pairs = [np.linalg.norm(p[:, i] - p[:, j], axis=-1) for i, j in ((0, 1), (0, 2), (1, 2))]
    total: Array = (y[:, 6:] ** 2).sum(-1) / 2 - sum(1 / r for r in pairs)
    return total


problem = Problem(
    acceleration=acceleration,
    start=(*FIRST, -FIRST[0], -FIRST[1], 0.0, 0.0, *HALF, *HALF, *LAST),
    span=(0.0, 6.32591398),
    step=0.05,
    methods=("semi_implicit_euler", "leapfrog", "yoshida4", "rk4", "dop853"),
    axes=((0, 1), (2, 3), (4, 5)),
    energy=energy,
)
