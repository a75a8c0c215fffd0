"""A place not to stray from."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, sqrt


@component
class Homing:
    """Turns back what strays from a ball: a = -strength (d / radius - 1) (x - center) / d outside.

    Inside it does nothing. A stretched ball measures d in its own, round frame.
    """

    center: Vector = quantity((0.0, 0.0, 0.0), "m")
    """Middle of the ball; as a curve over time it leads."""

    radius: Number = quantity(20.0, "m", above=0)
    """Radius of the ball."""

    strength: Number = quantity(2.0, "m/s2", at_least=0)
    """Acceleration at twice the radius."""

    stretch: Vector = quantity((1.0, 1.0, 1.0), "", above=0)
    """Stretches the ball along x, y, z to an ellipsoid."""

    @kernel
    def acceleration(p, q, t):
        s = p.stretch
        x = (q.x - p.center[0]) / s[0]
        y = (q.y - p.center[1]) / s[1]
        z = (q.z - p.center[2]) / s[2]
        d = sqrt(x * x + y * y + z * z + 1e-20)
        k = -p.strength * max(d / p.radius - 1.0, 0.0) / d
        return k * x / s[0], k * y / s[1], k * z / s[2]

    @kernel
    def potential(p, q, t):
        s = p.stretch
        x = (q.x - p.center[0]) / s[0]
        y = (q.y - p.center[1]) / s[1]
        z = (q.z - p.center[2]) / s[2]
        over = max(sqrt(x * x + y * y + z * z + 1e-20) / p.radius - 1.0, 0.0)
        return 0.5 * p.strength * p.radius * over * over
