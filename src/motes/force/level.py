"""A height to stay at."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Level:
    """Stays between two heights: a_z = (h - z) / response^2 - 2 v_z / response outside them,

    where h is the nearer one: a critically damped return. Between them the height is free.
    """

    low: Number = quantity(0.0, "m")
    """Lowest height."""

    high: Number = quantity(10.0, "m")
    """Highest; the same as the lowest for level flight."""

    response: Number = quantity(1.0, "s", above=0)
    """Time in which it returns."""

    @kernel
    def acceleration(p, q, t):
        off = min(q.z - p.low, 0.0) + max(q.z - p.high, 0.0)
        away = 1.0 if off * q.vz > 0.0 else 0.0
        at_once = 1.0 if p.high - p.low <= 0.0 else away
        return 0.0, 0.0, -(off / p.response + 2.0 * at_once * q.vz) / p.response
