"""Matter: atoms that attract one another and cannot overlap."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.interact._mixing import MIXING, TRUNCATIONS, cut_off, mixed_pair
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

    truncation: str = quantity("plain", menu=TRUNCATIONS)
    """plain: cut; shift: U falls to 0 at the cutoff; force_shift: the force does, too."""

    species: Any = quantity((), table="species")
    """Values of systems that differ: { argon = { epsilon = 1.0, sigma = 1.0 }, ... }."""

    mixing: str = quantity("lorentz_berthelot", menu=MIXING)
    """Between systems, epsilon is the geometric mean; sigma the arithmetic or the geometric one."""

    def reach(p):
        return p.cutoff

    def mixed(p, a, b):
        return mixed_pair(p, a, b)

    def constants(p):
        s6 = (p.sigma / p.cutoff) ** 6
        at_cut, slope = 4 * p.epsilon * (s6 - 1) * s6, 24 * p.epsilon * (2 * s6 - 1) * s6 / p.cutoff
        return {"four": 4 * p.epsilon, "sigma2": p.sigma**2, **cut_off(p, at_cut, slope)}

    @kernel
    def force(p, a, b, r):
        inverse = 1.0 / r.square
        s6 = (p.sigma2 * inverse) ** 3
        f = p.four * (12.0 * s6 - 6.0) * s6 * inverse
        if p.slope != 0.0:
            f -= p.slope / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        s6 = (p.sigma2 / r.square) ** 3
        return p.four * (s6 - 1.0) * s6 - p.shift + p.slope * r.length
