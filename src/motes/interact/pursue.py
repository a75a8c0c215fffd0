"""Hunting."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Pursue:
    """Hunters fly to where their prey will be: a = strength m / |m|,
    m = sum w (x_b + (v_b - v_a) T - x_a), T = min(d / |v_a|, foresight).

    w = (1 - d / radius)^2 / d^2 makes the closest count most; `nearest = 1` hunts that one alone.
    `systems` names hunters and prey, `sources` the prey. Reynolds (1999).
    """

    strength: Number = quantity(10.0, "m/s2", at_least=0)
    """Acceleration towards the prey."""

    radius: Number = quantity(30.0, "m", above=0)
    """How far a hunter sees."""

    foresight: Number = quantity(1.0, "s", at_least=0)
    """How far ahead it thinks at most."""

    def reach(p: Any) -> float:
        """Support radius [m]."""
        return float(p.radius)

    @kernel
    def near(p, a, b, r):
        v = sqrt(a.vx * a.vx + a.vy * a.vy + a.vz * a.vz + 1e-12)
        ahead = min(r.length / v, p.foresight)
        rest = (1.0 - r.length / p.radius) / max(r.length, 1e-6)
        w = rest * rest
        x = w * ((b.vx - a.vx) * ahead - r.x)
        y = w * ((b.vy - a.vy) * ahead - r.y)
        z = w * ((b.vz - a.vz) * ahead - r.z)
        return x, y, z

    @kernel
    def acceleration(p, a, s):
        k = p.strength / sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 1e-20)
        return k * s[0], k * s[1], k * s[2]
