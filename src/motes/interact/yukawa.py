"""Screened charges, such as dust in a plasma or colloids."""

from math import exp as exponential

from motes.catalog import Number, component, quantity
from motes.interact._mixing import TRUNCATIONS, cut_off
from motes.kernel import exp, kernel


@component
class Yukawa:
    """Potential U = strength e^(-r/screening) / r, cut off.

    Source: Yukawa, Proceedings of the Physico-Mathematical Society of Japan 17 (1935) 48.
    """

    strength: Number = quantity(1.0, "J m")
    """Above 0 it pushes apart."""

    screening: Number = quantity(1.0, "m", above=0)
    """Length after which others hide a particle."""

    cutoff: Number = quantity(4.0, "m", above=0)
    """Distance from which on there is no force."""

    truncation: str = quantity("plain", menu=TRUNCATIONS)
    """plain: cut; shift: U falls to 0 at the cutoff; force_shift: the force does, too."""

    def reach(p):
        return p.cutoff

    def constants(p):
        u = p.strength * exponential(-p.cutoff / p.screening) / p.cutoff
        return cut_off(p, u, u * (1 / p.cutoff + 1 / p.screening))

    @kernel
    def force(p, a, b, r):
        inverse = 1.0 / r.length
        u = p.strength * exp(-r.length / p.screening) * inverse
        f = (u * (inverse + 1.0 / p.screening) - p.slope) * inverse
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        u = p.strength * exp(-r.length / p.screening) / r.length
        return u - p.shift + p.slope * r.length
