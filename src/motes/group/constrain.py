"""Laws of velocities: what a group's forces want, restricted before every drift.

A law that defines `velocities(p, walkers, step)` sees where all that take part are, the velocities
that they had when the step began and those that the forces have made of them, and says which they
take. It is asked before every drift of a splitting method, so that it holds on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.surfaces import kernel_of_solids
from motes.interact.crowd.avoid import Walls
from motes.jit import blocks, share

Array = NDArray[Any]

MOST = 6
"""Walls that one person minds."""

ROWS = 1 << 13
"""Rows of one kernel call."""

SLOPE = 1e-3
"""Distance over which normals are measured [m]."""


@dataclass(frozen=True)
class Walkers:
    """What such a law sees of one system."""

    name: str
    position: Array
    """(3, n) [m]"""
    velocity: Array
    """(3, n) when the step began [m/s]"""
    wanted: Array
    """(3, n) after the forces [m/s]"""
    size: Array
    """(n,) diameter [m]"""
    walls: Callable[[Array, Array, float, float], Walls] = field(repr=False)
    """Half-planes of the solids, for positions (3, n), radii (n,), a horizon [s] and a reach [m]"""


class Ground:
    """The solids of a scene as walls for those who walk between them."""

    def __init__(self, solids: tuple[tuple[str, Component], ...]) -> None:
        self._kernel, self.most = None, min(len(solids), MOST)
        if solids:
            text = _walls_text(len(solids))
            self._kernel, self._K = kernel_of_solids(solids, "walls", text)

    def walls(
        self, time: float, position: Array, radius: Array, horizon: float, reach: float
    ) -> Walls:
        """Half-planes of the solids within `reach` [m] of people."""
        n = len(radius)
        walls = Walls(np.zeros((n, self.most, 3)), np.zeros(n, np.int64))
        parts = blocks(n, ROWS) if self._kernel else []

        def look(part: int) -> None:
            self._kernel(  # type: ignore[misc]
                position, radius, self._K, time, horizon, reach, *walls, *parts[part]
            )

        share(look, len(parts))
        return walls


def _walls_text(solids: int) -> str:
    """Source of the kernel that writes half-planes, n . v >= (radius - d) / horizon.

    A wall does not give way: within the horizon a person comes no nearer than to touch it. What is
    above or below, such as the ground, is no wall.
    """
    text = (
        "@kernel\ndef walls(position, radius, K, t, horizon, reach, plane, count, lo, hi):\n"
        f"    D, e = solids(scene(K, t)), {SLOPE!r}\n    for i in range(lo, hi):\n"
        "        x, y, z = F(position[0, i]), F(position[1, i]), F(position[2, i])\n"
        "        r, held = F(radius[i]), 0\n"
    )
    for k in range(solids):
        near = f"solid_{k}(D, "
        text += (
            f"        d = {near}x, y, z)\n"
            "        if d < reach + r and held < plane.shape[1]:\n"
            f"            nx = {near}x + e, y, z) - {near}x - e, y, z)\n"
            f"            ny = {near}x, y + e, z) - {near}x, y - e, z)\n"
            "            n = sqrt(nx * nx + ny * ny)\n"
            "            if n > e:\n"
            "                plane[i, held, 0] = nx / n\n"
            "                plane[i, held, 1] = ny / n\n"
            "                plane[i, held, 2] = (r - d) / horizon\n"
            "                held += 1\n"
        )
    return text + "        count[i] = held\n"


@dataclass
class Constraints:
    """The laws of velocities of one group."""

    laws: tuple[tuple[str, Component], ...]
    ground: Ground

    def apply(
        self,
        members: Mapping[str, Any],
        before: Mapping[str, Array],
        time: float,
        step: float,
        partners: Callable[[Component, list[Any]], list[Any]],
        values: Callable[[Component, float], Any],
    ) -> None:
        """Restrict the velocities of a group's members, in place, for a drift of `step` [s]."""

        def walls(position: Array, radius: Array, horizon: float, reach: float) -> Walls:
            return self.ground.walls(time, position, radius, horizon, reach)

        for _, law in self.laws:
            everybody = []
            for name, m in members.items():
                x, v = m.y[:3, : m.alive], m.y[3:, : m.alive]
                everybody.append(Walkers(name, x, before[name], v, _size(m, time), walls))
            chosen = partners(law, everybody)
            velocities = type(law).kernel("velocities")
            assert velocities is not None
            new = velocities(values(law, time), chosen, step)
            for walker, velocity in zip(chosen, new, strict=True):
                member = members[walker.name]
                member.y[3 : 3 + len(velocity), : member.alive] = velocity


def _size(member: Any, time: float) -> Array:
    size: Array = member.stepper.trait("size", member.rows, member.alive, time)
    return size
