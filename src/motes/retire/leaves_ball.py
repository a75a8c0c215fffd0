"""Death outside a ball."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel


@component
class LeavesBall:
    """Dies further than a radius from a centre.

    With a radius that is small for the first step and large from then on, it cuts a ball out of
    what an emitter has made, such as a round drop out of a crystal.
    """

    center: Vector = quantity((0.0, 0.0, 0.0), "m")
    """Centre of the ball."""

    radius: Number = quantity(10.0, "m", above=0)
    """Radius of the ball."""

    @kernel
    def dies(p, q, t):
        dx, dy, dz = q.x - p.center[0], q.y - p.center[1], q.z - p.center[2]
        return dx * dx + dy * dy + dz * dz > p.radius * p.radius
