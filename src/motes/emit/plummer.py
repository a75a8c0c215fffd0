"""A Plummer sphere of stars in equilibrium."""

from math import pi

from motes.catalog import Number, component, quantity
from motes.emit._directions import sphere_direction
from motes.kernel import kernel, pow, sin, sqrt


@kernel
def share_below(theta):
    """Integral of q^2 (1 - q^2)^(7/2) from 0 to q = sin(theta)."""
    waves = 7.0 * sin(2.0 * theta) - 2.0 * sin(4.0 * theta) - 13.0 / 6.0 * sin(6.0 * theta)
    waves -= 0.75 * sin(8.0 * theta) + 0.1 * sin(10.0 * theta)
    return (14.0 * theta + waves) / 512.0


@kernel
def speed_share(u):
    """Speed q in units of the escape speed, with density ~ q^2 (1 - q^2)^(7/2): by bisection."""
    wanted = u * (7.0 * pi / 512.0)
    low, high = 0.0, 0.5 * pi
    for _ in range(48):
        middle = 0.5 * (low + high)
        below = share_below(middle) < wanted
        low = middle if below else low
        high = high if below else middle
    return sin(0.5 * (low + high))


@component
class Plummer:
    """Stars of a Plummer sphere, density ~ (1 + r^2/a^2)^(-5/2), with isotropic velocities.

    The stars' own gravity holds them in equilibrium: positions and speeds are drawn from the
    distribution function f(E) ~ (-E)^(7/2) by inversion. Source: Aarseth, Henon and Wielen,
    Astronomy and Astrophysics 37 (1974) 183, appendix.
    """

    radius: Number = quantity(1.0, "m", above=0)
    """Plummer's scale radius a; half of the mass lies within 1.305 a."""

    mu: Number = quantity(1.0, "m3/s2", at_least=0)
    """Gravitational parameter G M of all stars together; 0 for stars at rest."""

    cutoff: Number = quantity(20.0, "", above=0)
    """Radius in scale radii beyond which no star is born; 20 leaves out 0.4 % of the mass."""

    draws = 6

    @kernel
    def birth(p, u, t, k):
        inside = pow(1.0 + 1.0 / (p.cutoff * p.cutoff), -1.5)
        mass = max(u[0] * inside, 1e-12)
        r = p.radius / sqrt(pow(mass, -2.0 / 3.0) - 1.0)
        x, y, z = sphere_direction(u[1], u[2])
        depth = sqrt(r * r + p.radius * p.radius)
        speed = speed_share(u[3]) * sqrt(2.0 * p.mu / depth)
        vx, vy, vz = sphere_direction(u[4], u[5])
        return r * x, r * y, r * z, speed * vx, speed * vy, speed * vz
