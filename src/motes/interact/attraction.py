"""Particle life: species that chase and flee each other."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Attraction:
    """What makes crowds look alive: a is pulled to, or driven from, every b that is near.

    a = strength f(r / radius): within the `core` f falls from 1 away from b to 0, beyond it f is a
    triangle of height `pull`. It need not be mutual: with `sources`, one species may chase another
    that flees it, and energy and momentum are not conserved. Source: Ventrella, Clusters (2007).
    """

    pull: Number = quantity(1.0, "", at_least=-1000, at_most=1000)
    """Height of the attraction in strengths; below 0 it repels."""

    strength: Number = quantity(1.0, "m/s2", at_least=0)
    """Acceleration at the closest distance."""

    radius: Number = quantity(0.5, "m", above=0)
    """Support radius."""

    core: Number = quantity(0.3, "", above=0, below=1)
    """Share of the radius within which all repel each other."""

    def reach(p):
        return p.radius

    @kernel
    def near(p, a, b, r):
        u = r.length / p.radius
        away = 1.0 - u / p.core
        there = 1.0 - abs(2.0 * u - 1.0 - p.core) / (1.0 - p.core)
        f = (away if u < p.core else -p.pull * max(there, 0.0)) / max(r.length, 1e-9)
        return f * r.x, f * r.y, f * r.z

    @kernel
    def acceleration(p, a, s):
        return p.strength * s[0], p.strength * s[1], p.strength * s[2]
