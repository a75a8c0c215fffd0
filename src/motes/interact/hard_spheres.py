"""Hard spheres: grains, balls and billiards that collide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.catalog import Integer, Number, component, quantity

if TYPE_CHECKING:
    from motes.group import Movers, Occasion


@component
class HardSpheres:
    """Collisions of spheres with their sizes as diameters, with restitution and friction.

    Where two have come to overlap in a step and still approach each other, an impulse along the
    line of their centres makes the relative velocity -restitution times what it was, Coulomb's
    friction opposes sliding, and both are moved apart; in rounds, since one leads to the next.
    Spheres that touch a solid collide with it in the same rounds, so that piles stand on the floor.
    Momentum is kept to rounding. Source: Moreau, in Nonsmooth Mechanics and Applications (1988).
    """

    restitution: Number = quantity(0.6, "", at_least=0, at_most=1)
    """Speed after a head-on collision over that before."""

    friction: Number = quantity(0.3, "", at_least=0)
    """Coefficient of friction between spheres."""

    rest_speed: Number = quantity(0.1, "m/s", at_least=0)
    """Speed of approach below which spheres do not bounce, so that piles come to rest; above what
    forces add to a speed in a step."""

    rounds: Integer = quantity(12, at_least=1, at_most=1000)
    """Most rounds of collisions in a step; piles need more of them."""

    def exchange(p: Any, movers: Sequence[Movers], when: Occasion) -> bool:
        """Let all that overlap collide; returns whether any were moved."""
        from motes.interact.collisions import Law, Spheres, collide, slabs
        from motes.interact.counting_sort import sorted_rows
        from motes.interact.search import Who
        from motes.neighbours import _around

        x = np.concatenate([one.position for one in movers], axis=1).astype(float)
        v = np.concatenate([one.velocity for one in movers], axis=1).astype(float)
        m = np.concatenate([one.mass for one in movers]).astype(float)
        size = np.concatenate([one.size for one in movers]).astype(float)
        if m.size < 2 or not size.max() > 0 or not np.isfinite(x).all():
            return False
        low, box = when.periodic.low[:, None], when.periodic.size
        inside = x - low
        slab, many = slabs(inside, float(size.max()), box)
        _, order = sorted_rows(np.concatenate([one.ids for one in movers]), 64)
        _, by_slab = sorted_rows(slab[order].astype(np.uint64), many.bit_length())
        order = order[by_slab]
        x, v, m, size = x[:, order], v[:, order], m[order], size[order]
        begins = np.searchsorted(slab[order], np.arange(many + 1))
        period, far = np.where(box > 0, box, np.inf), np.where(box > 0, box, 1e300)
        near = _around(inside[:, order].T, None, float(size.max()), period, Who.LATER)
        planes = when.planes(x, 0.5 * float(size.max()))
        law = Law(float(p.restitution), float(p.friction), float(p.rest_speed), int(p.rounds))
        if not collide(Spheres(x, v, m, size), near, begins, far, planes, law):
            return False
        back = np.empty_like(order)
        back[order] = np.arange(order.size)
        begin = 0
        for one in movers:
            rows = back[begin : begin + one.mass.size]
            one.position[:], one.velocity[:] = x[:, rows], v[:, rows]
            begin += one.mass.size
        return True
