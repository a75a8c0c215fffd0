"""Light from particles: a few lamps stand for all that shine, and light solids and smoke.

A splat of radiance L and diameter s sends L pi s^2 / 16 to each direction of the picture. In units
of what a white surface that faces the light gives off, as the sun's colour is, that is the strength
g = L s^2 / 16 over the squared distance. Lamps at p with spread r give at x, with d = p - x,
light = sum g max(n . d, 0) / (d^2 + r^2)^(3/2) to a surface of normal n, and half of
g / (d^2 + r^2) to matter that scatters to all sides. Lamps throw no shadows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share
from motes.renderer.layer import Layer

Array = NDArray[np.float32]

ROWS = 1 << 15
"""Particles per task: some milliseconds."""

DIM = 1 / 256
"""Lamps give, at their own spread, at least this part of the light that is there without them."""

_ZERO = np.float32(0)
_ONE = np.float32(1)
_HALF = np.float32(0.5)
_TINY = np.float32(1e-12)


def gather(layers: Sequence[Layer], darkness: float) -> Array:
    """Lamps (k, 7) for all light of the layers: position, squared spread, strength by colour.

    Each layer has up to 8, one for each octant about the centre of its light. Those too weak to be
    seen beside a light of `darkness` are left out.
    """
    found = [lamp for layer in layers if layer.emission > 0 for lamp in _of(layer)]
    bright = [lamp for lamp in found if lamp[4:].max() > DIM * darkness * (lamp[3] + _TINY)]
    return np.array(bright, np.float32).reshape(-1, 7)


def _of(layer: Layer) -> list[NDArray[np.float64]]:
    per_color = layer.emission / 16 * layer.color[:, 3].astype(float) * layer.size**2
    strength = per_color[:, None] * layer.color[:, :3]
    weight = strength.sum(axis=1)
    shines = np.isfinite(weight) & np.isfinite(layer.position).all(axis=1) & (weight > 0)
    strength, weight, position = strength[shines], weight[shines], layer.position[shines]
    if not len(weight):
        return []
    octant = (position > np.average(position, axis=0, weights=weight)) @ np.array([1, 2, 4])
    lamps = []
    for part in range(8):
        rows = octant == part
        if rows.any():
            center = np.average(position[rows], axis=0, weights=weight[rows])
            squares = ((position[rows] - center) ** 2).sum(axis=1)
            spread = np.average(squares, weights=weight[rows])
            lamps.append(np.concatenate([center, [spread], strength[rows].sum(axis=0)]))
    return lamps


def scattered(position: Array, lamps: Array) -> Array:
    """What lamps give to matter at positions (n, 3), per colour (n, 3)."""
    light = np.empty_like(position)
    tasks = blocks(len(position), ROWS)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        light[rows] = illuminate(position[rows], np.empty((0, 3), np.float32), lamps)

    share(task, len(tasks))
    return light


def illuminate(position: Array, normal: Array, lamps: Array) -> Array:
    """The light of lamps on surfaces at (n, 3), or without normals on matter there, (n, 3)."""
    light = np.empty((len(position), 3), np.float32)
    _illuminate(position, normal, np.ascontiguousarray(lamps.T), light)
    return light


@jit
def _illuminate(position: Any, normal: Any, lamps: Any, out: Any) -> None:
    surface = normal.shape[0] > 0
    for i in range(position.shape[0]):
        x, y, z = position[i, 0], position[i, 1], position[i, 2]
        nx, ny, nz = _ZERO, _ZERO, _ZERO
        if surface:
            nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        red, green, blue = _ZERO, _ZERO, _ZERO
        for k in range(lamps.shape[1]):
            dx, dy, dz = lamps[0, k] - x, lamps[1, k] - y, lamps[2, k] - z
            per = _ONE / (dx * dx + dy * dy + dz * dz + lamps[3, k] + _TINY)
            part = _HALF * per
            if surface:
                part = max(nx * dx + ny * dy + nz * dz, _ZERO) * per * np.float32(np.sqrt(per))
            red += part * lamps[4, k]
            green += part * lamps[5, k]
            blue += part * lamps[6, k]
        out[i, 0], out[i, 1], out[i, 2] = red, green, blue
