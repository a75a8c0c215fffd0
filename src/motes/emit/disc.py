"""A disc."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import cone_direction, disc_point
from motes.kernel import kernel


@component
class Disc:
    """Births spread evenly over a disc across the emitter's axis."""

    radius: Number = quantity(1.0, "m", at_least=0)
    """Radius of the disc."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, along the emitter's axis."""

    angle: Number = quantity(0.0, "degrees", at_least=0, at_most=180)
    """Half the opening of the cone of directions."""

    draws = 4

    @kernel
    def birth(p, u, t, k):
        x, y = disc_point(0.0, p.radius, u[0], u[1])
        dx, dy, dz = cone_direction(p.angle, u[2], u[3])
        return x, y, 0.0, p.speed * dx, p.speed * dy, p.speed * dz
