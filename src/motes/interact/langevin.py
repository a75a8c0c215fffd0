"""A bath that holds particles at a temperature by friction and random kicks."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.catalog import Number, component, quantity

if TYPE_CHECKING:
    from motes.group import Movers, Occasion


@component
class Langevin:
    """Thermostat: dv = -friction v dt + sqrt(2 friction k T / m) dW, solved exactly over a step.

    v becomes c v + sqrt((1 - c^2) k T / m) xi, with c = exp(-friction h) and xi normal. The noise
    hangs on particle and step, not on their order. Source: Bussi and Parrinello, Physical Review E
    75 (2007) 056707, equation 20.
    """

    energy: Number = quantity(1.0, "J", at_least=0)
    """k T: Boltzmann's constant times the temperature; in reduced units, the temperature."""

    friction: Number = quantity(1.0, "1/s", at_least=0)
    """Rate at which particles forget their velocity."""

    def exchange(p: Any, movers: Sequence[Movers], when: Occasion) -> bool:
        """Change the velocities of all particles."""
        from motes.interact.kicks import shaken
        from motes.philox import channel

        keep = exp(-p.friction * when.length)
        for one in movers:
            spread = np.sqrt((1 - keep**2) * p.energy / one.mass.astype(float))
            shaken(one, keep, spread, when.seed, channel(when.address), when.step)
        return False
