"""A will that changes its mind."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import int32, kernel, uint32
from motes.noise import mixed, moving_vector


@component
class Wander:
    """Every particle pushes its own way: a = strength n(t / time), |n| about 1.

    n goes smoothly from one random direction to the next. It is a function of the particle and the
    time alone, so that a finer step gives the same walk. After Reynolds (1999).
    """

    strength: Number = quantity(1.0, "m/s2", at_least=0)
    """Typical acceleration."""

    time: Number = quantity(1.0, "s", above=0)
    """Time from one direction to the next."""

    along: Vector = quantity((1.0, 1.0, 1.0), "", at_least=0, at_most=1)
    """How much the directions x, y, z count: [1, 1, 0] on the ground."""

    will: Number = quantity({"mean": 0.5, "spread": 0.5}, at_least=0, at_most=1, shape="number")
    """Which of all walks is a particle's own."""

    @kernel
    def acceleration(p, q, t):
        own = mixed(uint32(int32(p.will * 1e9)))
        x, y, z = moving_vector(own, t / p.time)
        return p.strength * p.along[0] * x, p.strength * p.along[1] * y, p.strength * p.along[2] * z
