"""Electric charges that feel each other up to a cutoff."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Charge:
    """Coulomb's force with a cutoff R at which it is 0: f = k q_a q_b (1/r^2 - 1/R^2).

    U = k q_a q_b (1/r - 2/R + r/R^2). Good where charges of both signs screen each other. Source:
    Fennell and Gezelter, Journal of Chemical Physics 124 (2006) 234104, equation 3 (undamped).
    """

    k: Number = quantity(8.9875517923e9, "N m2/C2", at_least=0)
    """Coulomb's constant (CODATA 2018)."""

    charge: Number = quantity(1.0e-6, "C")
    """Charge of a particle."""

    species: Any = quantity((), table="species")
    """Charges of systems that differ: { sodium = { charge = 1e-6 }, ... }."""

    cutoff: Number = quantity(2.0, "m", above=0)
    """Distance from which on there is no force."""

    def reach(p):
        return p.cutoff

    def mixed(p, a, b):
        own = dict(p.species)
        charges = [own.get(name, {}).get("charge", p.charge) for name in (a, b)]
        return {"product": p.k * charges[0] * charges[1]}

    def constants(p):
        return {"product": p.k * p.charge**2, "inverse2": p.cutoff**-2, "shift": 2 / p.cutoff}

    @kernel
    def force(p, a, b, r):
        f = p.product * (1.0 / r.square - p.inverse2) / r.length
        return f * r.x, f * r.y, f * r.z

    @kernel
    def potential(p, a, b, r):
        return p.product * (1.0 / r.length - p.shift + r.length * p.inverse2)
