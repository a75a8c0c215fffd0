"""Springs between near neighbours: a web that tears and heals."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class NearSpring:
    """A spring between any two particles nearer than its breaking length R: f = k (length - r).

    U = k ((r - length)^2 - (R - length)^2) / 2, so that it takes no energy to break one at R.
    """

    stiffness: Number = quantity(50.0, "N/m", at_least=0)
    """Force per stretch k."""

    length: Number = quantity(0.1, "m", at_least=0)
    """Length at rest."""

    breaking: Number = quantity(0.15, "m", above=0)
    """Length from which on there is no spring."""

    def reach(p):
        return p.breaking

    @kernel
    def force(p, a, b, r):
        f = p.stiffness * (p.length / r.length - 1.0)
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        stretch, most = r.length - p.length, p.breaking - p.length
        return 0.5 * p.stiffness * (stretch * stretch - most * most)
