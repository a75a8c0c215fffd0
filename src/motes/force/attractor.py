"""A point that attracts or repels."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, log, pow, sqrt


@component
class Attractor:
    """A point that pulls: a = -strength d / s^(falloff + 1), with s^2 = |d|^2 + softening^2.

    d is the vector from the point to the particle. A negative strength repels. `falloff` 2 is
    gravity with strength = G M; 0 is a constant pull, -1 a spring.
    """

    strength: Number = quantity(1.0, "m3/s2")
    """Acceleration at a distance of one metre (its unit goes with the falloff)."""

    position: Vector = quantity((0.0, 0.0, 0.0), "m")
    """Where the attractor is."""

    falloff: Number = quantity(2.0, "")
    """Power of the distance with which the pull falls."""

    softening: Number = quantity(0.1, "m", at_least=0)
    """Length below which the pull no longer grows (Plummer)."""

    @kernel
    def acceleration(p, q, t):
        x = q.x - p.position[0]
        y = q.y - p.position[1]
        z = q.z - p.position[2]
        s2 = x * x + y * y + z * z + p.softening * p.softening
        k = -p.strength * pow(max(s2, 1e-30), -0.5 * (p.falloff + 1.0))
        return k * x, k * y, k * z

    @kernel
    def potential(p, q, t):
        x = q.x - p.position[0]
        y = q.y - p.position[1]
        z = q.z - p.position[2]
        s = sqrt(max(x * x + y * y + z * z + p.softening * p.softening, 1e-30))
        n = p.falloff - 1.0
        if abs(n) < 1e-6:
            return p.strength * log(s)
        return -p.strength / n * pow(s, -n)
