"""A bath that holds particles at a temperature by scaling their velocities."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import TYPE_CHECKING, Any

from motes.catalog import Number, component, quantity

if TYPE_CHECKING:
    from motes.group import Movers, Occasion


@component
class Rescale:
    """Thermostat: all velocities times sqrt(1 + (h / time) (T0 / T - 1)) at each step of length h.

    Velocities count from the mean one, 3 N - 3 degrees of freedom. Source: Berendsen, Postma, van
    Gunsteren, DiNola and Haak, Journal of Chemical Physics 81 (1984) 3684, equation 11.
    """

    energy: Number = quantity(1.0, "J", above=0)
    """k T0: Boltzmann's constant times the temperature; in reduced units, the temperature."""

    time: Number = quantity(0.0, "s", at_least=0)
    """Time in which the temperature relaxes; 0 sets it at every step."""

    def exchange(p: Any, movers: Sequence[Movers], when: Occasion) -> bool:
        """Change the velocities of all particles."""
        n = sum(one.mass.size for one in movers)
        if n < 2:
            return False
        mass = sum(float(one.mass.sum(dtype=float)) for one in movers)
        mean = sum((one.velocity * one.mass).sum(axis=1, dtype=float) for one in movers) / mass
        away = [one.velocity - mean[:, None] for one in movers]
        pairs = zip(movers, away, strict=True)
        twice = sum(float((one.mass * (v**2).sum(axis=0)).sum()) for one, v in pairs)
        now = twice / (3 * n - 3)
        share = min(when.length / p.time, 1.0) if p.time else 1.0
        factor = sqrt(max(1 + share * (p.energy / now - 1), 0.0)) if now else 1.0
        for one, v in zip(movers, away, strict=True):
            one.velocity[:] = mean[:, None] + factor * v
        return False
