"""What is chosen from a tolerance alone: order, leaves and precision of the multipole method."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from motes.interact.gravity.softening import ROUGH

SINGLE_FROM = 4e-6
"""Smallest tolerance that single precision keeps."""

MIXED_FROM = 3e-8
"""Smallest tolerance that a mixture of both precisions keeps."""

HIGHEST = {True: 14, False: 8}
"""Highest order of harmonic expansions and of others: more would not be faster."""


@dataclass(frozen=True)
class Plan:
    """What is chosen from the tolerance alone."""

    order: int
    """Highest degree of the expansions."""
    low: int
    """The same where fewer terms are enough."""
    leaf: int
    """Most particles in a leaf."""
    real: type
    """Precision of expansions and pairs; places are always in double."""
    rough: bool = False
    """Whether pairs may be wrong by ROUGH."""
    mixed: bool = False
    """Whether most is in single precision where `real` is double: pairs with coordinates in two
    parts, and what moments of high degree add to local terms."""
    opening: float = 1.0
    """Largest (r_A + r_B) / R at which expansions are used, whatever their estimate."""


def plan(tolerance: float, law: str) -> Plan:
    """Order, leaf size and precision that are fast at a tolerance, found by measurement."""
    digits = -math.log10(tolerance)
    real = np.float32 if tolerance >= SINGLE_FROM else np.float64
    order = int(2.5 * digits - (2.0 if real is np.float32 else 4.0))
    order = min(max(2, order), HIGHEST[law != "plummer"])
    leaf = 52 if digits > 3.5 else 28
    rough, mixed = tolerance >= 4 * ROUGH, SINGLE_FROM > tolerance >= MIXED_FROM
    return Plan(order, max(round(0.645 * order), 1), leaf, real, rough, mixed)


def plans(tolerance: float, law: str) -> Iterator[Plan]:
    """The plan, and those that are left if it does not keep the tolerance: large forces that nearly
    cancel, as on a lattice, leave the errors of their pairs."""
    first = plan(tolerance, law)
    yield first
    if first.rough:
        yield replace(first, rough=False)
    if first.real is np.float32:
        yield replace(first, rough=False, real=np.float64)
    elif first.mixed:
        yield replace(first, mixed=False)
