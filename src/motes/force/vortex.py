"""A whirl around an axis."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, sqrt


@component
class Vortex:
    """A whirl that drives particles around an axis, pulls them in and lifts them.

    With r the distance from the axis and e the unit vectors around, inward and along it:
    a = (strength r e_around + pull r e_in + lift core e_along) / (r^2 + core^2).
    """

    strength: Number = quantity(1.0, "m2/s2")
    """Acceleration around the axis at one metre, counterclockwise."""

    pull: Number = quantity(0.0, "m2/s2")
    """Acceleration towards the axis at one metre."""

    lift: Number = quantity(0.0, "m2/s2")
    """Acceleration along the axis, times the core: lift / core on the axis itself."""

    position: Vector = quantity((0.0, 0.0, 0.0), "m")
    """A point of the axis."""

    axis: Vector = quantity((0.0, 0.0, 1.0), "")
    """Direction of the axis."""

    core: Number = quantity(0.1, "m", above=0)
    """Radius inside which the whirl weakens towards the axis."""

    @kernel
    def acceleration(p, q, t):
        n = 1.0 / sqrt(max(p.axis[0] ** 2 + p.axis[1] ** 2 + p.axis[2] ** 2, 1e-30))
        ax, ay, az = p.axis[0] * n, p.axis[1] * n, p.axis[2] * n
        x = q.x - p.position[0]
        y = q.y - p.position[1]
        z = q.z - p.position[2]
        along = x * ax + y * ay + z * az
        r2 = x * x + y * y + z * z - along * along
        k = 1.0 / (max(r2, 0.0) + p.core * p.core)
        around, inward = p.strength * k, p.pull * k
        up = p.lift * p.core * k + inward * along
        return (
            around * (ay * z - az * y) - inward * x + up * ax,
            around * (az * x - ax * z) - inward * y + up * ay,
            around * (ax * y - ay * x) - inward * z + up * az,
        )
