"""Death outside a box."""

from motes.catalog import Vector, component, quantity
from motes.kernel import kernel


@component
class LeavesBox:
    """Dies outside the box between two corners."""

    low: Vector = quantity((-10.0, -10.0, -10.0), "m")
    """The corner with the smallest coordinates."""

    high: Vector = quantity((10.0, 10.0, 10.0), "m")
    """The corner with the largest coordinates."""

    @kernel
    def dies(p, q, t):
        inside = (
            (q.x >= p.low[0])
            & (q.x <= p.high[0])
            & (q.y >= p.low[1])
            & (q.y <= p.high[1])
            & (q.z >= p.low[2])
            & (q.z <= p.high[2])
        )
        return not inside
