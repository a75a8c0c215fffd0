"""Sharks that swim."""

from typing import Any

import numpy as np

from motes.catalog import Number, component, quantity


@component
class Sharks:
    """A long body with a grey back and a white belly, that bends from side to side; fins and a
    tail that stands upright. Its size is the length.
    """

    rate: Number = quantity(0.8, "1/s", at_least=0, scope="scene")
    """Beats of the tail a second."""

    swing: Number = quantity(0.1, "", at_least=0, at_most=0.5, scope="scene")
    """How far the tail swings to a side, as a share of the length."""

    depth: Number = quantity(0.2, "", above=0, at_most=1, scope="scene")
    """Height of the body as a share of the length."""

    drawn_as = "sprites"
    upright = False

    def figure(p: Any, phase: Any, pace: Any) -> list[Any]:
        """Parts: slices of a back and a belly from nose to tail, then dots along each fin."""

        def bent(place: float) -> Any:
            u = 0.5 - place  # 0 at the nose, 1 at the tail's end.
            return p.swing * (0.1 + u * u) * np.sin(phase - 3.2 * u)

        parts: list[Any] = []
        for u in np.linspace(0, 1, 56):
            place = 0.5 - 0.86 * u
            high = p.depth * 1.72 * (u + 0.004) ** 0.5 * (1.02 - u) ** 0.85
            parts.append((place, bent(place), 0.2 * high, 0.95 * high, 0.55))
            parts.append((place, bent(place), -0.24 * high, 0.8 * high, 1.9))
        for t in np.linspace(0, 1, 20):
            for upper, long, high in ((1, 0.11, 0.2), (-1, 0.06, 0.11)):  # The tail's lobes.
                place = -0.36 - long * t
                dot = 0.04 * (1.15 - 0.6 * t)
                parts.append((place, bent(place), upper * high * t, dot, 0.6))
            for s in np.linspace(0, 1, 4):  # The back's fin, swept to behind.
                place = 0.09 - 0.1 * t - (0.11 - 0.08 * t) * s
                parts.append((place, bent(place), p.depth * 0.4 + 0.12 * t, 0.04, 0.5))
            for side in (-1, 1):  # The breast's fins.
                place = 0.2 - 0.13 * t
                left = bent(place) + side * (0.04 + 0.19 * t)
                dot = 0.06 * (1.1 - 0.6 * t)
                parts.append((place, left, -0.3 * p.depth - 0.05 * t, dot, 0.7))
        return parts
