"""Linear air resistance."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel


@component
class Drag:
    """Stokes drag, linear in speed: a = -(rate / mass) (v - wind)."""

    rate: Number = quantity(0.5, "kg/s", at_least=0)
    """Force per speed relative to the air."""

    wind: Vector = quantity((0.0, 0.0, 0.0), "m/s")
    """Velocity of the air."""

    needs = ("mass",)

    @kernel
    def relaxation(p, q, t):
        return p.rate / q.mass, p.wind[0], p.wind[1], p.wind[2]
