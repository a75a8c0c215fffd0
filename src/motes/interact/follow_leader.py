"""Following a leader."""

from typing import Any

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class FollowLeader:
    """To a place behind the leader, with his velocity: a = m / response^2 + 2 u / response,
    m = mean of x_b - behind v_b / |v_b| - x_a, u = mean of v_b - v_a, weighted by 1 - d / radius.

    A critically damped spring. `systems` names followers and leaders, `sources` the leaders.
    Reynolds (1999).
    """

    behind: Number = quantity(3.0, "m", at_least=0)
    """Distance behind the leader."""

    radius: Number = quantity(50.0, "m", above=0)
    """How far followers see."""

    response: Number = quantity(1.5, "s", above=0)
    """Time in which they come up."""

    def reach(p: Any) -> float:
        """Support radius [m]."""
        return float(p.radius)

    @kernel
    def near(p, a, b, r):
        w = 1.0 - r.length / p.radius
        back = p.behind / sqrt(b.vx * b.vx + b.vy * b.vy + b.vz * b.vz + 1e-12)
        x = w * (-r.x - back * b.vx)
        y = w * (-r.y - back * b.vy)
        z = w * (-r.z - back * b.vz)
        return x, y, z, w * (b.vx - a.vx), w * (b.vy - a.vy), w * (b.vz - a.vz), w

    @kernel
    def acceleration(p, a, s):
        k = 1.0 / (p.response * max(s[6], 1e-6))
        x = k * (s[0] / p.response + 2.0 * s[3])
        y = k * (s[1] / p.response + 2.0 * s[4])
        z = k * (s[2] / p.response + 2.0 * s[5])
        return x, y, z
