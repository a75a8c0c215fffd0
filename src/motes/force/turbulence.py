"""Turbulence as a force."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel
from motes.noise import curl


@component
class Turbulence:
    """A push in the direction of curl noise: a = strength curl(x / size, t / time).

    The noise is free of divergence, so that it swirls particles without gathering them (Bridson,
    Hourihan and Nordenstam 2007).
    """

    strength: Number = quantity(1.0, "m/s2", at_least=0)
    """Root mean square acceleration."""

    size: Number = quantity(1.0, "m", above=0)
    """Size of the largest swirls."""

    time: Number = quantity(2.0, "s", above=0)
    """Time in which the pattern changes."""

    octaves: Number = quantity(2, "", at_least=1, at_most=8)
    """Layers of ever finer swirls."""

    roughness: Number = quantity(0.5, "", at_least=0, at_most=1)
    """Amplitude of each layer relative to the one before."""

    scroll: Vector = quantity((0.0, 0.0, 0.0), "m/s")
    """Velocity with which the pattern moves."""

    seed: Number = quantity(0, "", at_least=0, at_most=1e6, scope="scene")
    """Another number gives another pattern."""

    @kernel
    def acceleration(p, q, t):
        scale = 1.0 / p.size
        x, y, z = curl(
            (q.x - p.scroll[0] * t) * scale,
            (q.y - p.scroll[1] * t) * scale,
            (q.z - p.scroll[2] * t) * scale,
            t / p.time,
            p.octaves,
            p.roughness,
            p.seed,
        )
        return p.strength * x, p.strength * y, p.strength * z
