"""A spring with drag: a little settles it, much is glue, and explicit methods fear the glue."""

from motes.problem import Array, Problem


def acceleration(t: float, x: Array, v: Array) -> tuple[float]:
    """Spring and drag."""
    return (-x[0] - 6.0 * v[0],)


problem = Problem(
    acceleration=acceleration,
    start=(1.0, 0.0),
    span=(0.0, 8.0),
    step=0.3,
    methods=("euler", "midpoint", "rk4", "backward_euler", "sdirk2"),
    labels=("x", "v"),
)
