"""People on foot."""

from typing import Any

import numpy as np

from motes.catalog import Color, Number, Vector, component, quantity


@component
class People:
    """A walking figure on its feet; the particle's size is the width of the shoulders, its place
    the ground below, its colour that of the coat.
    """

    rate: Number = quantity(0.95, "1/s", at_least=0, scope="scene")
    """Double steps a second."""

    skin: Color = quantity("#b08468", scope="scene")
    """Colour of the head."""

    shadow: Number = quantity(0.5, "", at_least=0, at_most=1, scope="scene")
    """How dark the shadow on the ground is."""

    light: Vector = quantity((0.0, 0.0, 1.0), "", scope="scene")
    """Direction of the light that throws the shadow, such as the sky's sun_direction."""

    drawn_as = "sprites"
    upright = True

    def figure(p: Any, phase: Any, pace: Any) -> list[Any]:
        """Parts: shadow, legs that swing with the pace, coat, arms, head."""
        swing = 0.5 * np.minimum(pace / 3.0, 1.0) * np.sin(phase)
        black = (0.02, 0.02, 0.025)
        dark, high = 0.55 * p.shadow, max(float(p.light[2]), 0.2)
        parts: list[Any] = []
        for k in range(14):
            far = 0.27 * k / high
            x, y = -far * p.light[0], -far * p.light[1]
            parts.append((x, y, 0.08, 1.1, black, 0.6 * dark, False))
        for side, way in ((-1, swing), (1, -swing)):
            for k in range(7):
                share = 1 - k / 7
                parts.append((way * share, 0.2 * side, 0.22 + 0.2 * k, 0.46, 0.22))
            for k in range(8):
                share = (k + 1) / 8
                parts.append((-0.7 * way * share, 0.48 * side, 2.75 - 0.17 * k, 0.44, 0.7))
        for k in range(7):
            up = 1.45 + 0.22 * k
            for left in (-0.2, 0.2):
                parts.append((0, left, up, 0.72, 0.75 + 0.05 * k))
        skin = tuple(float(c) for c in p.skin[:3])
        parts += [(0.04, 0, 3.4, 0.8, skin), (-0.1, 0, 3.52, 0.7, (0.05, 0.04, 0.035))]
        return parts
