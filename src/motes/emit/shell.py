"""The surface of a ball."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import sphere_direction
from motes.kernel import kernel, pow


@component
class Shell:
    """Births spread evenly between two spheres, flying away from the centre."""

    radius: Number = quantity(1.0, "m", at_least=0)
    """Outer radius."""

    thickness: Number = quantity(0.0, "m", at_least=0)
    """Depth of the shell below its outer radius; 0 is the surface alone."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, away from the centre."""

    draws = 3

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = sphere_direction(u[0], u[1])
        inner = max(p.radius - p.thickness, 0.0)
        low = inner * inner * inner
        high = p.radius * p.radius * p.radius
        r = pow(max(low + u[2] * (high - low), 1e-30), 1.0 / 3.0)
        return r * dx, r * dy, r * dz, p.speed * dx, p.speed * dy, p.speed * dz
