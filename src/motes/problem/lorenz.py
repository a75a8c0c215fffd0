"""Lorenz's butterfly: every error grows, so that methods part ways, but stay on the butterfly."""

from motes.problem import Array, Problem


def slope(t: float, y: Array) -> tuple[float, float, float]:
    """Lorenz (1963)."""
    return 10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]


problem = Problem(
    slope=slope,
    start=(1.0, 1.0, 20.0),
    span=(0.0, 8.0),
    step=0.02,
    methods=("euler", "midpoint", "rk4", "tsit5", "dop853"),
    axes=((0, 2),),
    labels=("x", "z"),
)
