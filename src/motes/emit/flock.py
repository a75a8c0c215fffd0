"""A flock on the wing."""

from math import pi

from motes.catalog import Number, Vector, component, quantity
from motes.emit._directions import sphere_direction
from motes.kernel import cos, kernel, sin, sqrt


@component
class Flock:
    """Births in a ball, denser towards its middle (~ 1/r), that fly along the emitter's axis.

    The flock is on a turn: ball and headings are bent around one centre, so that all turn about it
    at the same rate if they keep their speed there. It is a flock from its first step on, without
    the time that chance velocities need to become alike.
    """

    radius: Number = quantity(5.0, "m", above=0)
    """Radius of the ball."""

    stretch: Vector = quantity((1.0, 1.0, 1.0), "", above=0)
    """Stretches the ball: towards the inside of the turn, upright to it, along the axis."""

    speed: Number = quantity(5.0, "m/s")
    """Speed of all."""

    bend: Number = quantity(40.0, "degrees", at_least=0, at_most=180)
    """How far those ahead, at the ball's radius, have turned against those in the middle."""

    draws = 3

    @kernel
    def birth(p, u, t, k):
        dx, dy, dz = sphere_direction(u[0], u[1])
        r = p.radius * sqrt(u[2])
        x, y, s = r * dx * p.stretch[0], r * dy * p.stretch[1], r * dz * p.stretch[2]
        per_length = max(p.bend, 1e-3) * (pi / 180.0) / (p.radius * p.stretch[2])
        turned = s * per_length
        across, along = sin(turned), cos(turned)
        # 1 - cos and s itself from sines: no difference of numbers that are alike.
        half = sin(0.5 * turned)
        inwards = x * along + 2.0 * half * half / per_length
        ahead = across / per_length - x * across
        return inwards, y, ahead, p.speed * across, 0.0, p.speed * along
