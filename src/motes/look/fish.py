"""Fish that swim."""

from typing import Any

import numpy as np

from motes.catalog import Number, component, quantity


@component
class Fish:
    """A body with a light belly and a dark back that bends from side to side; its size is the
    length.
    """

    rate: Number = quantity(3.0, "1/s", at_least=0, scope="scene")
    """Beats of the tail a second."""

    swing: Number = quantity(0.09, "", at_least=0, at_most=0.5, scope="scene")
    """How far the tail swings to a side, as a share of the length."""

    depth: Number = quantity(0.3, "", above=0, at_most=1, scope="scene")
    """Height of the body as a share of the length."""

    drawn_as = "sprites"
    upright = False

    def figure(p: Any, phase: Any, pace: Any) -> list[Any]:
        """Parts: slices from nose to tail, each a back and a belly, then the fins."""
        parts: list[Any] = []
        for k in range(9):
            place = 0.44 - 0.095 * k
            high = p.depth * np.sin(np.pi * (0.12 + 0.8 * (k / 8) ** 0.8))
            side = p.swing * (0.2 + k / 8) ** 2 * np.sin(phase - 0.5 * k)
            parts.append((place, side, 0.24 * high, 0.8 * high, 0.45))
            parts.append((place, side, -0.2 * high, 0.85 * high, 1.25))
        for k in range(1, 4):
            side = 1.4 * p.swing * np.sin(phase - 4.0 - 0.5 * k)
            for up in (-1, 1):
                parts.append((-0.36 - 0.045 * k, side, up * 0.16 * p.depth * k, 0.09, 0.6))
        for k in range(3):
            parts.append((0.1 - 0.06 * k, 0, p.depth * (0.62 - 0.08 * k), 0.09, 0.4))
        return parts
