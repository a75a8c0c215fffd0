"""Rigid rotation: the field of the lecture's circle."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel


@component
class Rotation:
    """Rigid rotation around a vertical axis: u = rate (-(y - y0), x - x0, 0).

    The exact paths are circles; Euler's method spirals outward by sqrt(1 + (rate h)^2) a step.
    """

    rate: Number = quantity(1.0, "rad/s")
    """Angular speed, counterclockwise seen from above."""

    position: Vector = quantity((0.0, 0.0, 0.0), "m")
    """A point of the axis."""

    @kernel
    def velocity(p, q, t):
        return -p.rate * (q.y - p.position[1]), p.rate * (q.x - p.position[0]), 0.0
