"""How crowded it is, and how fast people walk there: the fundamental diagram."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import STRICT, jit

GAMMA = 1.913
"""Weidmann's constant [1/m2]."""

JAM = 5.4
"""Density at which nobody walks any more [1/m2]."""

CREEP = 0.05
"""Least share of the speed: even the densest crowd presses on."""


@jit(flags=STRICT)
def walking(density: Any) -> Any:
    """Share of the free speed at a density [1/m2]: 1 - exp(-1.913 (1 / density - 1 / 5.4)).

    Source: Weidmann, Transporttechnik der Fussgaenger, ETH Zuerich (1993), equation 4.
    """
    if not density > 0.0:
        return 1.0
    return max(1.0 - np.exp(-GAMMA * (1.0 / density - 1.0 / JAM)), CREEP)


@jit(flags=STRICT, inline=True)
def weight(square: Any, reach2: Any) -> Any:
    """Share of a person at a squared distance in the density: W = 3 (1 - r2 / R2)^2 / (pi R2).

    Its integral over the disc of radius R is 1 [1/m2].
    """
    rest = max(1.0 - square / reach2, 0.0)
    return 3.0 / (np.pi * reach2) * rest * rest
