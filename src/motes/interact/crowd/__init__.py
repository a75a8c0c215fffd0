"""A crowd: people on the ground who keep out of each other's way."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Flag, Integer, Number, component, quantity

if TYPE_CHECKING:
    from motes.group.constrain import Walkers


@component(kind="interact", name="crowd")
class Crowd:
    """People who keep out of each other's way: of all horizontal velocities that lead to no
    collision, each takes the one nearest to what its forces want.

    Two that may collide each do half of what is needed, and solids are walls. Whoever obeys can
    always stand still, so that none overlap. A person is as wide as its `size`. Source: van den
    Berg, Guy, Lin and Manocha, Reciprocal n-body collision avoidance, Robotics Research (2011).
    """

    reach: Number = quantity(3.0, "m", above=0)
    """Distance up to which others are minded."""

    nearest: Integer = quantity(10, at_least=0, at_most=100)
    """Of those within reach, how many are minded."""

    horizon: Number = quantity(2.0, "s", above=0)
    """Time for which a velocity must be free of collisions; longer gives way earlier."""

    wall_horizon: Number = quantity(0.5, "s", above=0)
    """The same for solids."""

    height: Number = quantity(1.0, "m")
    """Height above its place at which a person minds solids: lower ones are stepped over."""

    margin: Number = quantity(0.05, "m", at_least=0)
    """Gap that two keep between them if they can."""

    top_speed: Number = quantity(2.0, "m/s", above=0)
    """Nobody is faster."""

    density_slows: Flag = quantity(False)
    """Whether the top speed falls in a dense crowd, by Weidmann's diagram (1993)."""

    def velocities(p: Any, walkers: Sequence[Walkers], step: float) -> list[NDArray[Any]]:
        """Horizontal velocities (2, n) [m/s] of each system's people for the next step."""
        from motes.interact.crowd.avoid import Rules, avoid

        joined = [np.concatenate([getattr(w, key) for w in walkers], axis=-1)
                  for key in ("position", "velocity", "wanted", "size")]  # fmt: skip
        position, velocity, wanted, size = joined
        chest = position + np.array([[0], [0], [p.height]], position.dtype)
        walls = walkers[0].walls(chest, size / 2, p.wall_horizon, p.wall_horizon * p.top_speed)
        rules = Rules(p.reach, p.margin, max(p.horizon, step), step, p.top_speed, p.density_slows)
        chosen = avoid(position[:2], velocity[:2], wanted[:2], size / 2, walls, rules, p.nearest)
        ends = np.cumsum([len(w.size) for w in walkers])
        return np.split(chosen, ends[:-1], axis=1)
