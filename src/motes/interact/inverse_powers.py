"""Repulsion and attraction by two powers of the distance."""

from motes.catalog import Number, component, quantity
from motes.interact._mixing import TRUNCATIONS, cut_off
from motes.kernel import kernel, pow


@component
class InversePowers:
    """Force f = k1/r^m - k2/r^n along the line between two particles, cut off.

    With m > n it pushes near particles apart and pulls far ones together; they rest at
    r = (k1/k2)^(1/(m - n)).
    """

    k1: Number = quantity(1.0, "N m^m", at_least=0)
    """Strength of the repulsion."""

    m: Number = quantity(4.0, "", above=1, at_most=40)
    """Power of the repulsion."""

    k2: Number = quantity(1.0, "N m^n", at_least=0)
    """Strength of the attraction."""

    n: Number = quantity(2.0, "", above=1, at_most=40)
    """Power of the attraction."""

    cutoff: Number = quantity(2.5, "m", above=0)
    """Distance from which on there is no force."""

    truncation: str = quantity("plain", menu=TRUNCATIONS)
    """plain: cut; shift: U falls to 0 at the cutoff; force_shift: the force does, too."""

    def reach(p):
        return p.cutoff

    def constants(p):
        repulsion, attraction = p.k1 * p.cutoff**-p.m, p.k2 * p.cutoff**-p.n
        at_cut = p.cutoff * (repulsion / (p.m - 1) - attraction / (p.n - 1))
        return cut_off(p, at_cut, repulsion - attraction)

    @kernel
    def force(p, a, b, r):
        f = p.k1 * pow(r.length, -p.m) - p.k2 * pow(r.length, -p.n) - p.slope
        f = f / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        repulsion = p.k1 * pow(r.length, 1.0 - p.m) / (p.m - 1.0)
        return (
            repulsion - p.k2 * pow(r.length, 1.0 - p.n) / (p.n - 1.0) - p.shift + p.slope * r.length
        )
