"""Balls."""

from typing import Any

import numpy as np

from motes.catalog import Number, Vector, component, quantity


@component
class Balls:
    """A shaded ball for each particle: bright where it faces the light, dark elsewhere.

    Four dots stand for Lambert's law: each is smaller, brighter and nearer to the light than the
    one below it. Give it an opacity of 1, and a camera on the side of the light.
    """

    light: Vector = quantity((0.3, -0.6, 0.9), "", scope="scene")
    """Direction towards the light, such as the sky's sun_direction."""

    shade: Number = quantity(0.25, "", at_least=0, at_most=1, scope="scene")
    """Brightness of the dark side."""

    rate = 0.0
    drawn_as = "points"
    upright = True

    def figure(p: Any, phase: Any, pace: Any) -> list[Any]:
        """Parts: the dark side, two that face the light more and more, the highlight."""
        light = np.asarray(p.light, float)
        light = light / max(float(np.linalg.norm(light)), 1e-9)
        parts: list[Any] = []
        for far, size, lit in ((0.0, 1.0, 0.0), (0.1, 0.8, 0.5), (0.22, 0.55, 1.0)):
            parts.append((*(far * light), size, p.shade + (1 - p.shade) * lit, 1.0, False))
        return [*parts, (*(0.38 * light), 0.22, 1.7, 0.8, False)]
