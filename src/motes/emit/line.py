"""A line."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import cone_direction
from motes.kernel import kernel


@component
class Line:
    """Births spread evenly along a line on the emitter's x axis, centred on its position."""

    length: Number = quantity(1.0, "m", at_least=0)
    """Length of the line."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, along the emitter's axis."""

    angle: Number = quantity(0.0, "degrees", at_least=0, at_most=180)
    """Half the opening of the cone of directions."""

    draws = 3

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = cone_direction(p.angle, u[1], u[2])
        x = p.length * (u[0] - 0.5)
        return x, 0.0, 0.0, p.speed * dx, p.speed * dy, p.speed * dz
