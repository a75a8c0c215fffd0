"""A disc of stars around a heavy centre."""

from math import pi

from motes.catalog import Number, component, quantity
from motes.kernel import cos, exp, kernel, log, pow, sin, sqrt


@kernel
def exponential_radius(u, inner, outer):
    """Radius x between two radii with density ~ x exp(-x): by bisection."""
    first, last = (1.0 + inner) * exp(-inner), (1.0 + outer) * exp(-outer)
    wanted = first + u * (last - first)
    low, high = inner, outer
    for _ in range(48):
        middle = 0.5 * (low + high)
        nearer = (1.0 + middle) * exp(-middle) > wanted
        low = middle if nearer else low
        high = high if nearer else middle
    return 0.5 * (low + high)


@kernel
def normal_pair(u, v):
    """Two normal numbers from two uniform ones (Box and Muller 1958)."""
    radius = sqrt(-2.0 * log(1.0 - u))
    return radius * cos(2.0 * pi * v), radius * sin(2.0 * pi * v)


@component
class DiscGalaxy:
    """Stars of an exponential disc, density ~ exp(-R / scale), on nearly circular orbits.

    They go counterclockwise around the emitter's axis and a softened mass at its position, with
    frequencies Omega^2 = mu (R^2 + softening^2)^(-3/2) and, of epicycles,
    kappa^2 = Omega^2 (4 - 3 R^2 / (R^2 + softening^2)). Random motion has the ratio of epicycles,
    sigma_phi / sigma_R = kappa / (2 Omega). Sources: Freeman, Astrophysical Journal 160 (1970) 811;
    Toomre, same 139 (1964) 1217; Binney and Tremaine, Galactic Dynamics (2008), sections 3.2.3 and
    4.4.3.
    """

    mu: Number = quantity(1.0, "m3/s2", above=0)
    """Gravitational parameter G M of the centre."""

    softening: Number = quantity(0.1, "m", at_least=0)
    """Plummer's softening of the centre's gravity."""

    scale: Number = quantity(1.0, "m", above=0)
    """Length over which the density of stars falls by e."""

    inner: Number = quantity(0.0, "", at_least=0)
    """Where the disc begins, in scales."""

    outer: Number = quantity(5.0, "", above=0)
    """Where the disc ends, in scales."""

    height: Number = quantity(0.02, "", at_least=0)
    """Standard deviation of the distance from the plane, as a share of the radius."""

    dispersion: Number = quantity(0.0, "", at_least=0)
    """Standard deviation of the radial speed, as a share of the circular speed. A disc that pulls
    on itself is stable where Toomre's Q = sigma_R kappa / (3.36 G Sigma) is above 1."""

    draws = 6

    @kernel
    def birth(p, u, t, k):
        r = p.scale * exponential_radius(u[0], p.inner, p.outer)
        c, s = cos(2.0 * pi * u[1]), sin(2.0 * pi * u[1])
        depth2 = max(r * r + p.softening * p.softening, 1e-30)
        omega = sqrt(p.mu * pow(depth2, -1.5))
        high, rising = normal_pair(u[2], u[3])
        out, ahead = normal_pair(u[4], u[5])
        sigma = p.dispersion * omega * r
        kappa = sqrt(4.0 - 3.0 * r * r / depth2)
        radial, around = sigma * out, omega * r + 0.5 * kappa * sigma * ahead
        # Up and down as a harmonic oscillation of frequency omega: the thickness stays.
        z, vz = p.height * r * high, p.height * r * omega * rising
        return r * c, r * s, z, radial * c - around * s, radial * s + around * c, vz
