"""A ball."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import sphere_direction
from motes.kernel import kernel, pow


@component
class Sphere:
    """Births spread evenly through a ball, flying away from its centre."""

    radius: Number = quantity(1.0, "m", at_least=0)
    """Radius of the ball."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, away from the centre."""

    draws = 3

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = sphere_direction(u[0], u[1])
        r = p.radius * pow(max(u[2], 1e-30), 1.0 / 3.0)
        return r * dx, r * dy, r * dz, p.speed * dx, p.speed * dy, p.speed * dz
