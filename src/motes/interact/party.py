"""Parties that stay together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.catalog import Integer, Number, component, quantity

if TYPE_CHECKING:
    from motes.group.members import Bodies


@component
class Party:
    """Parties stay together: a = strength (x_m - x) / |x_m - x| once a member is further than
    `room` from the middle x_m of its party, rising to that from 0 over another `room`.

    A party is `members` births of one emitter after one another: friends, a family, a squad; the
    emitter `parties` puts them side by side. Attraction of groups of pedestrians: Moussaid, Perozo,
    Garnier, Helbing and Theraulaz, PLoS ONE 5 (2010) e10047, equation 4. It knows no periods.
    """

    members: Integer = quantity(3, at_least=1)
    """How many births are a party."""

    strength: Number = quantity(2.0, "m/s2", at_least=0)
    """Acceleration towards the others when one is far from them."""

    room: Number = quantity(0.8, "m", above=0)
    """Distance from the middle up to which one feels free; (members - 1) / 2 times the shoulders'
    width and more."""

    def accelerations(p: Any, bodies: Sequence[Bodies]) -> list[Any]:
        """Accelerations (3, n) [m/s2] of each system."""
        found = []
        for body in bodies:
            stream, number = body.births()
            party = np.stack([stream, (number - 1) // p.members])
            _, which, count = np.unique(party, axis=1, return_inverse=True, return_counts=True)
            which = which.reshape(-1)
            way = np.stack([np.bincount(which, x.astype(float)) / count for x in body.position])
            way = way[:, which] - body.position
            far = np.sqrt((way * way).sum(axis=0))
            pull = p.strength * np.clip(far / p.room - 1.0, 0.0, 1.0) / np.maximum(far, 1e-9)
            found.append((pull * way).astype(body.position.dtype))
        return found
