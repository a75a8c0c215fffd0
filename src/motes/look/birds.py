"""Birds on the wing."""

from typing import Any

import numpy as np

from motes.catalog import Number, component, quantity


@component
class Birds:
    """A body between two wings that beat; the particle's size is the span."""

    rate: Number = quantity(6.0, "1/s", at_least=0, scope="scene")
    """Wing beats a second."""

    beat: Number = quantity(0.7, "", at_least=0, at_most=1.5, scope="scene")
    """How far wings go up and down; 0 for gliding."""

    drawn_as = "sprites"
    upright = False

    def figure(p: Any, phase: Any, pace: Any) -> list[Any]:
        """Parts: head, body, tail, and wings of dots that thin out and sweep back."""
        parts: list[Any] = [(0.2, 0, 0, 0.14), (0.1, 0, 0, 0.2), (-0.02, 0, 0, 0.2)]
        parts += [(-0.14, 0, 0, 0.16, 0.9), (-0.25, 0, 0, 0.14, 0.85)]
        for k in range(1, 8):
            out = 0.07 * k
            up = p.beat * out * np.sin(phase - 0.12 * k)
            back = 0.08 - 0.35 * max(out - 0.2, 0.0) - 0.05 * (k > 5)
            for side in (-1, 1):
                parts.append((back, side * out * (1 - 0.1 * p.beat), up, 0.21 - 0.018 * k, 0.92))
        return parts
