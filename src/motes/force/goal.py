"""A place to go to."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, sqrt


@component
class Goal:
    """Heads for a place and arrives there: a = -(v - u) / response,
    u = speed min(1, d / arrival) (place - x) / d, with d the distance.

    Seek and arrive of Reynolds, Steering behaviors for autonomous characters (1999). `plane` says
    which directions count: a crowd walks in x and y.
    """

    place: Vector = quantity((0.0, 0.0, 0.0), "m")
    """Where to go; as a curve over time it leads."""

    speed: Number = quantity(1.34, "m/s", at_least=0)
    """Speed on the way; 1.34 m/s is a pedestrian's (Weidmann 1993)."""

    arrival: Number = quantity(1.0, "m", above=0)
    """Distance from which on it slows down."""

    response: Number = quantity(0.5, "s", above=0)
    """Time in which the velocity follows (Helbing and Molnar 1995)."""

    along: Vector = quantity((1.0, 1.0, 1.0), "", at_least=0, at_most=1)
    """How much the directions x, y, z count: [1, 1, 0] on the ground, [1, 0, 0] for a line."""

    @kernel
    def relaxation(p, q, t):
        x = p.along[0] * (p.place[0] - q.x)
        y = p.along[1] * (p.place[1] - q.y)
        z = p.along[2] * (p.place[2] - q.z)
        d = sqrt(x * x + y * y + z * z + 1e-20)
        pace = p.speed / max(d, p.arrival)
        return 1.0 / p.response, pace * x, pace * y, pace * z
