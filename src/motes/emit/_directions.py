"""Random directions and points that several shapes share."""

from math import pi

from motes.kernel import cos, kernel, sin, sqrt


@kernel
def cone_direction(angle, u, v):
    """Unit vector spread evenly over the cap of half-angle `angle` [degrees] around +z.

    cos(theta) is uniform between cos(angle) and 1 (Archimedes' hat-box theorem).
    """
    height = 1.0 - u * (1.0 - cos(angle * (pi / 180.0)))
    across = sqrt(max(1.0 - height * height, 0.0))
    turn = 2.0 * pi * v
    return across * cos(turn), across * sin(turn), height


@kernel
def sphere_direction(u, v):
    """Unit vector spread evenly over the whole sphere."""
    height = 1.0 - 2.0 * u
    across = sqrt(max(1.0 - height * height, 0.0))
    turn = 2.0 * pi * v
    return across * cos(turn), across * sin(turn), height


@kernel
def disc_point(inner, outer, u, v):
    """Point spread evenly over the ring between two radii [m] in the plane z = 0."""
    radius = sqrt(inner * inner + u * (outer * outer - inner * inner))
    turn = 2.0 * pi * v
    return radius * cos(turn), radius * sin(turn)
