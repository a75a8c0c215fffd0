"""Bodies on Kepler orbits."""

from math import pi

from motes.catalog import Number, component, quantity
from motes.kernel import cos, floor, kernel, sin, sqrt


@kernel
def eccentric_anomaly(mean, e):
    """E of Kepler's equation E - e sin(E) = mean [radians], which has its root in mean +- e."""
    low, high = mean - e, mean + e
    for _ in range(52):
        middle = 0.5 * (low + high)
        below = middle - e * sin(middle) < mean
        low = middle if below else low
        high = high if below else middle
    return 0.5 * (low + high)


@component
class KeplerOrbit:
    """Bodies on ellipses around the emitter's position, by their orbital elements.

    The reference plane lies across the emitter's axis. Give the emitter the velocity of what the
    bodies go around. Source: Murray and Dermott, Solar System Dynamics (1999), section 2.4 and
    equations 2.119 to 2.122.
    """

    mu: Number = quantity(1.0, "m3/s2", above=0)
    """Gravitational parameter G (M + m) of what they go around and the body itself."""

    semi_major_axis: Number = quantity(1.0, "m", above=0)
    """Half of the ellipse's length."""

    eccentricity: Number = quantity(0.0, "", at_least=0, below=1)
    """How long the ellipse is; 0 is a circle."""

    inclination: Number = quantity(0.0, "degrees")
    """Angle between the orbit and the reference plane."""

    node: Number = quantity(0.0, "degrees")
    """Longitude of the ascending node, where the orbit crosses the plane upward."""

    pericentre: Number = quantity(0.0, "degrees")
    """Argument of the pericentre: its angle from the ascending node."""

    anomaly: Number = quantity(0.0, "degrees")
    """Mean anomaly at birth: the share of the period since the pericentre, as an angle."""

    draws = 0

    @kernel
    def birth(p, u, t, k):
        turns = p.anomaly / 360.0
        e = p.eccentricity
        angle = eccentric_anomaly(2.0 * pi * (turns - floor(turns)), e)
        c, s, flat = cos(angle), sin(angle), sqrt(1.0 - e * e)
        a, b = p.semi_major_axis, p.semi_major_axis * flat
        # In the orbit's own plane: x to the pericentre, motion counterclockwise.
        speed = sqrt(p.mu / a) / (1.0 - e * c)
        x, y, vx, vy = a * (c - e), b * s, -speed * s, speed * flat * c
        degree = pi / 180.0
        cw, sw = cos(p.pericentre * degree), sin(p.pericentre * degree)
        ci, si = cos(p.inclination * degree), sin(p.inclination * degree)
        cn, sn = cos(p.node * degree), sin(p.node * degree)
        px, py, pz = cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si
        qx, qy, qz = -cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si
        wx, wy, wz = px * vx + qx * vy, py * vx + qy * vy, pz * vx + qz * vy
        return px * x + qx * y, py * x + qy * y, pz * x + qz * y, wx, wy, wz
