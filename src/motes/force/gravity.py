"""Uniform gravity."""

from motes.catalog import Vector, component, quantity
from motes.kernel import kernel


@component
class Gravity:
    """Uniform gravity: a = g."""

    g: Vector = quantity((0.0, 0.0, -9.81), "m/s2")
    """Acceleration of everything; the Earth's by default."""

    @kernel
    def acceleration(p, q, t):
        return p.g[0], p.g[1], p.g[2]

    @kernel
    def potential(p, q, t):
        return -(p.g[0] * q.x + p.g[1] * q.y + p.g[2] * q.z)
