"""Keeping a distance from the others of a flock."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Separation:
    """Away from others that are close: a = strength sum (1 - d / radius) r / d, r = x_a - x_b.

    The weight ends softly at the radius, so that nobody who comes or goes makes a jolt. The first
    rule of Reynolds, Flocks, herds, and schools (SIGGRAPH 1987).
    """

    strength: Number = quantity(10.0, "m/s2", at_least=0)
    """Acceleration from one at no distance."""

    radius: Number = quantity(2.0, "m", above=0)
    """Distance up to which others are too close."""

    def reach(p: Any) -> float:
        """Support radius [m]."""
        return float(p.radius)

    def constants(p: Any) -> dict[str, float]:
        """1 / radius."""
        return {"per_radius": 1.0 / p.radius}

    @kernel
    def near(p, a, b, r):
        w = r.inverse - p.per_radius
        return w * r.x, w * r.y, w * r.z

    @kernel
    def acceleration(p, a, s):
        return p.strength * s[0], p.strength * s[1], p.strength * s[2]
