"""A spring with drag: a little settles it, much is glue, and explicit methods fear the glue."""

from motes.problem import Problem

problem = Problem(
    acceleration=lambda t, x, v: -x - 6.0 * v,
    start=(1.0, 0.0),
    span=(0.0, 8.0),
    step=0.3,
    methods=("euler", "midpoint", "rk4", "backward_euler", "sdirk2"),
    labels=("x", "v"),
)
