"""Solids near particles, as planes: what collisions between particles have to bear in mind."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.surfaces import kernel_of_solids
from motes.jit import blocks, each

MOST = 6
"""Solids that one particle touches."""

ROWS = 1 << 13
"""Rows of one kernel call."""

SLOPE = 1e-4
"""Distance over which normals are measured [m]."""


class Planes(NamedTuple):
    """Planes near particles: those of particle i are `gap[i, :held[i]]`, with their normals."""

    gap: NDArray[np.float64]
    """(n, most) distance of the particle [m]."""
    normal: NDArray[np.float64]
    """(n, most, 3) away from the solid."""
    held: NDArray[np.int64]


class Contacts:
    """The solids of a scene that collide."""

    def __init__(self, solids: tuple[tuple[str, Component], ...]) -> None:
        hard = tuple(pair for pair in solids if pair[1].values["collides"].document())
        self._kernel, self.most = None, min(len(hard), MOST)
        if hard:
            self._kernel, self._K = kernel_of_solids(hard, "contacts", _text(len(hard)))

    def near(self, position: NDArray[Any], reach: float, time: float) -> Planes:
        """Solids within `reach` [m] of positions (3, n) [m] at a time, as planes."""
        n = position.shape[1]
        planes = Planes(
            np.zeros((n, self.most)), np.zeros((n, self.most, 3)), np.zeros(n, np.int64)
        )
        if self._kernel is not None:
            each(self._kernel, (position, self._K, time, reach, *planes), blocks(n, ROWS))
        return planes


def _text(solids: int) -> str:
    text = (
        "@kernel\ndef contacts(position, K, t, reach, gap, normal, count, lo, hi):\n"
        f"    D, e = solids(scene(K, t)), {SLOPE!r}\n    for i in range(lo, hi):\n"
        "        x, y, z = F(position[0, i]), F(position[1, i]), F(position[2, i])\n"
        "        held = 0\n"
    )
    for k in range(solids):
        near = f"solid_{k}(D, "
        text += (
            f"        d = {near}x, y, z)\n"
            "        if d < reach and held < gap.shape[1]:\n"
            f"            nx = {near}x + e, y, z) - {near}x - e, y, z)\n"
            f"            ny = {near}x, y + e, z) - {near}x, y - e, z)\n"
            f"            nz = {near}x, y, z + e) - {near}x, y, z - e)\n"
            "            n = sqrt(nx * nx + ny * ny + nz * nz)\n"
            "            if n > e:\n"
            "                gap[i, held] = d\n"
            "                normal[i, held, 0] = nx / n\n"
            "                normal[i, held, 1] = ny / n\n"
            "                normal[i, held, 2] = nz / n\n"
            "                held += 1\n"
        )
    return text + "        count[i] = held\n"
