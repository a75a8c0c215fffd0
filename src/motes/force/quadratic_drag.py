"""Air resistance at high speed."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, sqrt


@component
class QuadraticDrag:
    """Newton drag, quadratic in speed: a = -(k / mass) |v - wind| (v - wind).

    For a sphere of radius r in air of density rho, k = rho C pi r^2 / 2 with C about 0.47.
    """

    k: Number = quantity(0.05, "kg/m", at_least=0)
    """Force per squared speed relative to the air."""

    wind: Vector = quantity((0.0, 0.0, 0.0), "m/s")
    """Velocity of the air."""

    needs = ("mass",)

    @kernel
    def relaxation(p, q, t):
        x = q.vx - p.wind[0]
        y = q.vy - p.wind[1]
        z = q.vz - p.wind[2]
        rate = p.k / q.mass * sqrt(x * x + y * y + z * z)
        return rate, p.wind[0], p.wind[1], p.wind[2]
