"""A slow weight on a stiff spring: explicit methods must follow the spring, implicit need not."""

from motes.problem import Array, Problem


def acceleration(t: float, x: Array, v: Array) -> tuple[float, float]:
    """A soft spring to the origin, a stiff one between the two."""
    pull = 400.0 * (x[1] - x[0])
    return -x[0] + pull, -pull


problem = Problem(
    acceleration=acceleration,
    start=(1.0, 1.02, 0.0, 0.0),
    span=(0.0, 6.0),
    step=0.06,
    methods=("rk4", "leapfrog", "implicit_midpoint", "sdirk2", "radau5"),
    axes=((0, 2),),
    labels=("x of the weight", "its speed"),
    energy=lambda y: (
        (y[:, 2:] ** 2).sum(-1) / 2 + y[:, 0] ** 2 / 2 + 200 * (y[:, 1] - y[:, 0]) ** 2
    ),
)
