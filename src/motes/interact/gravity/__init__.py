"""Gravity between particles: every particle pulls on every other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Number, component, quantity

if TYPE_CHECKING:
    from motes.group import Bodies


@component(kind="interact", name="gravity")
class Gravity:
    """Newton's gravity: a_i = G sum_j m_j (x_j - x_i) / |x_j - x_i|^3, softened at short range.

    The sum runs over all pairs, or with a `tolerance` over far ones together, by the fast multipole
    method. Sources: Springel, Yoshida and White, New Astronomy 6 (2001) 79, equation A1, for the
    spline softening; Greengard and Rokhlin, Journal of Computational Physics 73 (1987) 325.
    """

    G: Number = quantity(6.6743e-11, "m3/(kg s2)", at_least=0)
    """Constant of gravity (CODATA 2018); 1 in the units of stellar dynamics."""

    softening: Number = quantity(0.0, "m", at_least=0)
    """Length below which two particles pull less than two points would."""

    softening_kernel: str = quantity("spline", menu=("spline", "plummer"))
    """spline: exactly Newton beyond 2.8 softenings s; plummer: r / (r^2 + s^2)^1.5 everywhere."""

    tolerance: Number = quantity(0.0, "", at_least=0, at_most=0.1)
    """Root-mean-square error of the accelerations as a share of theirs; 0 sums all pairs."""

    sources: Any = quantity((), table="names")
    """Systems whose mass pulls on all that take part; all of them when none is named."""

    def accelerations(p: Any, bodies: Sequence[Bodies]) -> list[NDArray[Any]]:
        """Accelerations (3, n) [m/s2] of each system's particles."""
        from motes.gravity import acceleration
        from motes.interact.gravity.among import field_among

        return field_among(p, bodies, acceleration)

    def energy(p: Any, bodies: Sequence[Bodies]) -> float:
        """Potential energy [J]: of two sources once, of all others in the sources' field."""
        from motes.gravity import potential
        from motes.interact.gravity.among import field_among, pulls

        total = 0.0
        for body, phi in zip(bodies, field_among(p, bodies, potential), strict=True):
            share = 0.5 if pulls(p, body) else 1.0
            total += share * float(np.dot(body.mass.astype(float), phi))
        return total
