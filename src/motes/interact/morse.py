"""Bonds that stretch and break."""

from math import exp as exponential

from motes.catalog import Number, component, quantity
from motes.interact._mixing import TRUNCATIONS, cut_off
from motes.kernel import exp, kernel


@component
class Morse:
    """Potential U = depth ((1 - e^(-(r - length)/width))^2 - 1), cut off.

    Source: Morse, Physical Review 34 (1929) 57, equation 4.
    """

    depth: Number = quantity(1.0, "J", at_least=0)
    """Depth of the potential."""

    length: Number = quantity(1.0, "m", above=0)
    """Distance of rest."""

    width: Number = quantity(0.2, "m", above=0)
    """Width of the well."""

    cutoff: Number = quantity(2.5, "m", above=0)
    """Distance from which on there is no force."""

    truncation: str = quantity("plain", menu=TRUNCATIONS)
    """plain: cut; shift: U falls to 0 at the cutoff; force_shift: the force does, too."""

    def reach(p):
        return p.cutoff

    def constants(p):
        e = exponential(-(p.cutoff - p.length) / p.width)
        return cut_off(p, p.depth * (e - 2) * e, 2 * p.depth / p.width * (e - 1) * e)

    @kernel
    def force(p, a, b, r):
        e = exp((p.length - r.length) / p.width)
        f = (2.0 * p.depth / p.width * (e - 1.0) * e - p.slope) / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        e = exp((p.length - r.length) / p.width)
        return p.depth * (e - 2.0) * e - p.shift + p.slope * r.length
