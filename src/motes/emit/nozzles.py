"""A ring of nozzles on a head that may turn."""

from math import pi

from motes.catalog import Number, component, quantity
from motes.emit._directions import cone_direction
from motes.kernel import cos, floor, kernel, sin


@component
class Nozzles:
    """Nozzles evenly around a head, such as a sprinkler's or a fountain's; births take turns.

    Birth k leaves nozzle k mod count at the azimuth heading + 360 k / count [degrees].
    """

    count: Number = quantity(4.0, "", at_least=1, at_most=1000, scope="scene")
    """Number of nozzles; a whole number spreads them evenly."""

    heading: Number = quantity(0.0, "degrees", scope="scene")
    """Azimuth of the first nozzle; a curve over time turns the head."""

    radius: Number = quantity(0.0, "m", at_least=0)
    """Distance of the nozzles from the axis."""

    elevation: Number = quantity(45.0, "degrees", at_least=-90, at_most=90)
    """Angle between a jet and the plane across the axis."""

    speed: Number = quantity(5.0, "m/s")
    """Speed at birth."""

    around: Number = quantity(0.0, "m/s")
    """Added speed around the axis, such as that of the turning nozzle, counterclockwise."""

    angle: Number = quantity(0.0, "degrees", at_least=0, at_most=180)
    """Half the opening of a jet."""

    draws = 2

    @kernel
    def birth(p, u, t, k):
        turn = (p.heading + 360.0 * (k / p.count - floor(k / p.count))) * (pi / 180.0)
        east, north = cos(turn), sin(turn)
        rise = p.elevation * (pi / 180.0)
        out, up = cos(rise), sin(rise)
        # The cone's axis +z goes to the jet's direction, its -x upright and its y around the head.
        a, b, c = cone_direction(p.angle, u[0], u[1])
        outward = p.speed * (out * c + up * a)
        sideways = p.speed * b + p.around
        return (
            p.radius * east,
            p.radius * north,
            0.0,
            outward * east - sideways * north,
            outward * north + sideways * east,
            p.speed * (up * c - out * a),
        )
