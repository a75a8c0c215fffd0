"""Soft spheres that push where they overlap."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, pow


@component
class SoftSphere:
    """Repulsion within a diameter d: U = stiffness d^2 (1 - r/d)^exponent / exponent.

    Exponent 2 is a linear spring, 2.5 the contact of elastic balls after Hertz. Source: O'Hern,
    Silbert, Liu and Nagel, Physical Review E 68 (2003) 011306, equation 1.
    """

    stiffness: Number = quantity(100.0, "N/m", at_least=0)
    """Force per overlap, for exponent 2."""

    diameter: Number = quantity(0.1, "m", above=0)
    """Distance at which spheres touch."""

    exponent: Number = quantity(2.0, "", above=1, at_most=12)
    """Power of the overlap in the potential."""

    def reach(p):
        return p.diameter

    @kernel
    def force(p, a, b, r):
        overlap = 1.0 - r.length / p.diameter
        f = p.stiffness * p.diameter * pow(max(overlap, 0.0), p.exponent - 1.0) / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        overlap = max(1.0 - r.length / p.diameter, 0.0)
        return p.stiffness * p.diameter**2 * pow(overlap, p.exponent) / p.exponent
