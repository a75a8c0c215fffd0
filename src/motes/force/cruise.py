"""The speed of one's own."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Cruise:
    """Keeps a speed in whatever direction: a = ((speed - |v|) / response) v / |v|."""

    speed: Number = quantity(10.0, "m/s", at_least=0)
    """Speed that it returns to."""

    response: Number = quantity(1.0, "s", above=0)
    """Time in which a difference falls to a third (1/e)."""

    @kernel
    def acceleration(p, q, t):
        v = sqrt(q.vx * q.vx + q.vy * q.vy + q.vz * q.vz + 1e-20)
        k = (p.speed / v - 1.0) / p.response
        return k * q.vx, k * q.vy, k * q.vz
