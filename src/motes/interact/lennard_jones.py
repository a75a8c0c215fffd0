"""Matter: atoms that attract one another and cannot overlap."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class LennardJones:
    """Potential U = 4 epsilon ((sigma/r)^12 - (sigma/r)^6), cut off.

    Source: Allen and Tildesley, Computer Simulation of Liquids (2017), equations 1.6 and 5.11.
    """

    epsilon: Number = quantity(1.0, "J", at_least=0)
    """Depth of the potential."""

    sigma: Number = quantity(1.0, "m", above=0)
    """Distance at which the potential is 0; its minimum is at 1.122 sigma."""

    cutoff: Number = quantity(2.5, "m", above=0)
    """Distance from which on there is no force."""

    def reach(p):
        return p.cutoff

    def constants(p):
        return {"four": 4 * p.epsilon, "sigma2": p.sigma**2}

    @kernel
    def force(p, a, b, r):
        inverse = 1.0 / r.square
        s6 = (p.sigma2 * inverse) ** 3
        f = p.four * (12.0 * s6 - 6.0) * s6 * inverse
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        s6 = (p.sigma2 / r.square) ** 3
        return p.four * (s6 - 1.0) * s6
