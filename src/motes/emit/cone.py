"""A nozzle that throws into a cone."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import cone_direction, disc_point
from motes.kernel import kernel


@component
class Cone:
    """A nozzle: births on a small disc, with directions spread evenly over a cone."""

    speed: Number = quantity(1.0, "m/s")
    """Speed at birth."""

    angle: Number = quantity(15.0, "degrees", at_least=0, at_most=180)
    """Half the opening of the cone."""

    radius: Number = quantity(0.0, "m", at_least=0)
    """Radius of the nozzle."""

    draws = 4

    @kernel
    def birth(p, u, t, k):
        x, y = disc_point(0.0, p.radius, u[2], u[3])
        dx, dy, dz = cone_direction(p.angle, u[0], u[1])
        return x, y, 0.0, p.speed * dx, p.speed * dy, p.speed * dz
