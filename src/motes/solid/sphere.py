"""A ball."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Sphere:
    """A ball around its position: distance = |x| - radius."""

    radius: Number = quantity(1.0, "m", above=0)
    """Radius of the ball."""

    @kernel
    def distance(p, x, y, z):
        return sqrt(x * x + y * y + z * z) - p.radius
