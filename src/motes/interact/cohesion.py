"""Staying with the others."""

from typing import Any

import numpy as np

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Cohesion:
    """Towards the middle of those in sight: a = strength sum w (x_b - x_a) / (radius (sum w +
    0.05)).

    w = 1 - d / radius, in a cone of vision around the way one flies. The third rule of Reynolds,
    Flocks, herds, and schools (SIGGRAPH 1987). With `nearest = 7` it is that of starlings, who mind
    a number of others and no distance: Ballerini et al., PNAS 105 (2008) 1232.
    """

    strength: Number = quantity(5.0, "m/s2", at_least=0)
    """Acceleration when the middle is at the radius."""

    radius: Number = quantity(5.0, "m", above=0)
    """How far one sees."""

    angle: Number = quantity(135.0, "degrees", above=0, at_most=180)
    """Half the opening of the cone of vision; at 180 one sees all around."""

    def reach(p: Any) -> float:
        """Support radius [m]."""
        return float(p.radius)

    def constants(p: Any) -> dict[str, float]:
        """`edge`: cosine of the cone's half angle, below -1 where it is open; 1 / radius."""
        edge = -2.0 if p.angle >= 180 else float(np.cos(np.radians(p.angle)))
        return {"edge": edge, "per_radius": 1.0 / p.radius}

    @kernel
    def near(p, a, b, r):
        v = sqrt(a.vx * a.vx + a.vy * a.vy + a.vz * a.vz)
        ahead = -(a.vx * r.x + a.vy * r.y + a.vz * r.z)
        seen = ahead >= p.edge * v * r.length
        w = 1.0 - r.length * p.per_radius if seen else 0.0
        return w * r.x, w * r.y, w * r.z, w

    @kernel
    def acceleration(p, a, s):
        k = -p.strength / (p.radius * (s[3] + 0.05))
        return k * s[0], k * s[1], k * s[2]
