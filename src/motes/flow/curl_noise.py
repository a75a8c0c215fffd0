"""Turbulent flow without divergence."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel
from motes.noise import curl


@component
class CurlNoise:
    """A swirling flow: u = speed curl(x / size, t / time) + drift, free of divergence.

    Bridson, Hourihan and Nordenstam, Curl-noise for procedural fluid flow, 2007.
    """

    speed: Number = quantity(1.0, "m/s", at_least=0)
    """Root mean square speed of the swirls."""

    size: Number = quantity(1.0, "m", above=0)
    """Size of the largest swirls."""

    time: Number = quantity(2.0, "s", above=0)
    """Time in which the pattern changes."""

    octaves: Number = quantity(2, "", at_least=1, at_most=8)
    """Layers of ever finer swirls."""

    roughness: Number = quantity(0.5, "", at_least=0, at_most=1)
    """Amplitude of each layer relative to the one before."""

    drift: Vector = quantity((0.0, 0.0, 0.0), "m/s")
    """Mean velocity; the pattern moves with it."""

    seed: Number = quantity(0, "", at_least=0, at_most=1e6, scope="scene")
    """Another number gives another pattern."""

    @kernel
    def velocity(p, q, t):
        scale = 1.0 / p.size
        x, y, z = curl(
            (q.x - p.drift[0] * t) * scale,
            (q.y - p.drift[1] * t) * scale,
            (q.z - p.drift[2] * t) * scale,
            t / p.time,
            p.octaves,
            p.roughness,
            p.seed,
        )
        return p.speed * x + p.drift[0], p.speed * y + p.drift[1], p.speed * z + p.drift[2]
