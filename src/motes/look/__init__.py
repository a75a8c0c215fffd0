"""How a system is drawn: as points, streaks or soft sprites, or as figures.

A look says `drawn_as`, one of points, streaks and sprites. One that defines
`figure(p, phase, pace)` puts a body together from dots (`figure.py`), which stands upright or turns
with its way (`upright`).
"""

from __future__ import annotations

from motes.catalog import Kind, Number, attribute, quantity


class _Common:
    emission: Number = quantity(1.0, "", at_least=0, scope="scene")
    """Light that a particle sends out, as a multiple of its colour; it adds up."""

    opacity: Number = quantity(0.0, "", at_least=0, at_most=1, scope="scene")
    """How much a particle covers of what is behind it, at its centre."""

    softness: Number = quantity(0.0, "m", at_least=0, scope="scene")
    """Distance over which it fades where it meets a solid."""


KIND = Kind("look", "look", "scene", (), _Common)
__getattr__ = attribute("look")
