"""Flight from hunters."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Evade:
    """Away from where a hunter will be: a = strength sum (1 - d / radius) m / |m|,
    m = x_a - x_b - (v_b - v_a) T, T = min(d / |v_b|, foresight).

    `systems` names prey and hunters, `sources` the hunters. Reynolds (1999).
    """

    strength: Number = quantity(20.0, "m/s2", at_least=0)
    """Acceleration when the hunter is there."""

    radius: Number = quantity(15.0, "m", above=0)
    """Distance at which prey begins to flee."""

    foresight: Number = quantity(0.3, "s", at_least=0)
    """How far ahead it thinks at most."""

    def reach(p: Any) -> float:
        """Support radius [m]."""
        return float(p.radius)

    @kernel
    def near(p, a, b, r):
        v = sqrt(b.vx * b.vx + b.vy * b.vy + b.vz * b.vz + 1e-12)
        ahead = min(r.length / v, p.foresight)
        x = r.x - (b.vx - a.vx) * ahead
        y = r.y - (b.vy - a.vy) * ahead
        z = r.z - (b.vz - a.vz) * ahead
        w = (1.0 - r.length / p.radius) / sqrt(x * x + y * y + z * z + 1e-12)
        return w * x, w * y, w * z

    @kernel
    def acceleration(p, a, s):
        return p.strength * s[0], p.strength * s[1], p.strength * s[2]
