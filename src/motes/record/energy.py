"""Energy, momentum and what else a closed system keeps: to judge a simulation by."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Matter(NamedTuple):
    """Particles of one system: `position` and `velocity` (3, n) [m, m/s], `mass` (n,) [kg]."""

    position: NDArray[Any]
    velocity: NDArray[Any]
    mass: NDArray[Any]


@dataclass(frozen=True)
class Measures:
    """Sums over all particles at one instant, in double precision."""

    time: float
    """Scene time [s]."""

    mass: float
    """sum m [kg]."""

    kinetic: float
    """sum m v^2 / 2 [J]."""

    potential: float
    """Potential energy [J] of interactions, and of the forces that have a potential."""

    momentum: Floats
    """sum m v (3,) [kg m/s]."""

    angular_momentum: Floats
    """sum m x cross v (3,) [kg m2/s], about the origin."""

    center: Floats
    """Center of mass sum m x / sum m (3,) [m]."""

    @property
    def energy(self) -> float:
        """Kinetic and potential energy [J]."""
        return self.kinetic + self.potential

    @property
    def virial_ratio(self) -> float:
        """2 T / |U|, which is 1 for a self-gravitating system in equilibrium; NaN without U.

        Source: Clausius, Annalen der Physik 217 (1870) 124.
        """
        return 2.0 * self.kinetic / abs(self.potential) if self.potential else float("nan")


def to_json(measures: Measures) -> dict[str, Any]:
    """Fields as JSON holds them."""
    fields = {f.name: getattr(measures, f.name) for f in dataclasses.fields(measures)}
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}


def from_json(fields: dict[str, Any]) -> Measures:
    """The same measures again.

    Raises:
        TypeError: these are not the fields of measures.
    """
    values: dict[str, Any] = {
        k: np.array(v) if isinstance(v, list) else v for k, v in fields.items()
    }
    return Measures(**values)


def measure(time: float, systems: Iterable[Matter], potential: float) -> Measures:
    """Sum up systems; `potential` [J] is the potential energy of them all."""
    mass = kinetic = 0.0
    momentum, angular, weighted = np.zeros(3), np.zeros(3), np.zeros(3)
    for matter in systems:
        x, v, m = (np.asarray(part, float) for part in matter)
        mass += m.sum()
        kinetic += 0.5 * (m * (v**2).sum(axis=0)).sum()
        momentum += v @ m
        angular += np.cross(x, v, axis=0) @ m
        weighted += x @ m
    center = weighted / mass if mass else weighted
    return Measures(time, float(mass), float(kinetic), potential, momentum, angular, center)
