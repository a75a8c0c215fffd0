"""Shapes that bounce particles, hide what is behind them, and are drawn.

A solid defines `distance(p, x, y, z)`: the signed distance [m] from its surface in its own frame,
negative inside. It must not grow faster than the distance itself (a Lipschitz constant of 1), or
impacts could be missed; a solid whose distance is linear says `flat = True`, which is quicker.
Pose, normal, the instant of impact, restitution, friction and drawing are written once, in the
engine.
"""

from __future__ import annotations

from motes.catalog import Color, Flag, Kind, Number, Vector, attribute, quantity


class _Common:
    position: Vector = quantity((0.0, 0.0, 0.0), "m", scope="scene")
    """Where the solid's origin is."""

    rotation: Vector = quantity((0.0, 0.0, 0.0), "degrees", scope="scene")
    """Turns around x, then y, then z."""

    restitution: Number = quantity(0.5, "", at_least=0, at_most=1, scope="scene")
    """Share of the normal speed that an impact returns."""

    friction: Number = quantity(0.2, "", at_least=0, scope="scene")
    """Coulomb's coefficient: tangential over normal impulse, at most."""

    color: Color = quantity("#808080", scope="scene")
    """Colour of its surface."""

    visible: Flag = quantity(True)
    """Whether it is drawn."""

    collides: Flag = quantity(True)
    """Whether particles bounce off it."""


KIND = Kind("solid", "solid", "scene", ("distance",), _Common)
__getattr__ = attribute("solid")
