"""A box."""

from motes.catalog import Number, Vector, component, quantity
from motes.emit._directions import cone_direction
from motes.kernel import kernel


@component
class Box:
    """Births spread evenly through a box centred on the emitter's position."""

    size: Vector = quantity((1.0, 1.0, 1.0), "m", at_least=0)
    """Edge lengths."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, along the emitter's axis."""

    angle: Number = quantity(0.0, "degrees", at_least=0, at_most=180)
    """Half the opening of the cone of directions."""

    draws = 5

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = cone_direction(p.angle, u[3], u[4])
        return (
            p.size[0] * (u[0] - 0.5),
            p.size[1] * (u[1] - 0.5),
            p.size[2] * (u[2] - 0.5),
            p.speed * dx,
            p.speed * dy,
            p.speed * dz,
        )
