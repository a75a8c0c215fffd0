"""A point."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import cone_direction
from motes.kernel import kernel


@component
class Point:
    """All births at one point, in directions spread evenly over a cone around the axis."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth."""

    angle: Number = quantity(0.0, "degrees", at_least=0, at_most=180)
    """Half the opening of the cone of directions; 180 is every direction."""

    draws = 2

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = cone_direction(p.angle, u[0], u[1])
        return 0.0, 0.0, 0.0, p.speed * dx, p.speed * dy, p.speed * dz
