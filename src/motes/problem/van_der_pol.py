"""Van der Pol's oscillator: long slow stretches and sudden jumps, the more so the stiffer it is."""

from motes.problem import Array, Problem


def slope(t: float, y: Array) -> tuple[float, float]:
    """Stiffness 5."""
    return y[1], 5.0 * (1 - y[0] ** 2) * y[1] - y[0]


problem = Problem(
    slope=slope,
    start=(2.0, 0.0),
    span=(0.0, 12.0),
    step=0.05,
    methods=("euler", "rk4", "tsit5", "radau5", "rodas4"),
    labels=("x", "speed"),
)
