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
from motes.renderer.camera import Vector
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
    radius2 = layer.size[shines].astype(float) ** 2 / 4
    if not len(weight):
        return []
    octant = (position > np.average(position, axis=0, weights=weight)) @ np.array([1, 2, 4])
    lamps = []
    for part in range(8):
        rows = octant == part
        if rows.any():
            center = np.average(position[rows], axis=0, weights=weight[rows])
            # No lamp is smaller than its particles, or one alone would blind itself.
            squares = ((position[rows] - center) ** 2).sum(axis=1) + radius2[rows]
            spread = np.average(squares, weights=weight[rows])
            lamps.append(np.concatenate([center, [spread], strength[rows].sum(axis=0)]))
    return lamps


def scattered(position: Array, lamps: Array) -> Array:
    """What lamps give to matter at positions (n, 3), per colour (n, 3)."""
    light = np.empty_like(position)
    columns = np.ascontiguousarray(lamps.T)
    tasks = blocks(len(position), ROWS)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        _scatter(position[rows], columns, light[rows])

    share(task, len(tasks))
    return light


@jit
def _scatter(position: Any, lamps: Any, out: Any) -> None:
    for i in range(position.shape[0]):
        red, green, blue = _ZERO, _ZERO, _ZERO
        for k in range(lamps.shape[1]):
            dx, dy = lamps[0, k] - position[i, 0], lamps[1, k] - position[i, 1]
            dz = lamps[2, k] - position[i, 2]
            part = _HALF / (dx * dx + dy * dy + dz * dz + lamps[3, k] + _TINY)
            red += part * lamps[4, k]
            green += part * lamps[5, k]
            blue += part * lamps[6, k]
        out[i, 0], out[i, 1], out[i, 2] = red, green, blue


def illuminate(
    origin: Vector,
    rays: Array,
    distance: Array,
    normal: Array,
    index: NDArray[np.int32],
    colors: Array,
    haze: float,
    lamps: Array,
    out: Array,
) -> None:
    """Add what solids show of the light of lamps to out (n, 4), where rays (n, 3) met them.

    distance, normal and index are those of `Hits`; colors (k, 3) the colours of the solids.
    """
    setting = np.array([*origin, 1.0 / haze], np.float32)
    columns = np.ascontiguousarray(lamps.T)
    _illuminate(setting, rays, distance, normal, index, colors, columns, out)


@jit
def _illuminate(
    setting: Any,
    rays: Any,
    distance: Any,
    normal: Any,
    index: Any,
    colors: Any,
    lamps: Any,
    out: Any,
) -> None:
    for i in range(rays.shape[0]):
        which, t = index[i], distance[i]
        if which < 0:
            continue
        x, y = setting[0] + t * rays[i, 0], setting[1] + t * rays[i, 1]
        z = setting[2] + t * rays[i, 2]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        red, green, blue = _ZERO, _ZERO, _ZERO
        for k in range(lamps.shape[1]):
            dx, dy, dz = lamps[0, k] - x, lamps[1, k] - y, lamps[2, k] - z
            per = _ONE / (dx * dx + dy * dy + dz * dz + lamps[3, k] + _TINY)
            part = max(nx * dx + ny * dy + nz * dz, _ZERO) * per * np.float32(np.sqrt(per))
            red += part * lamps[4, k]
            green += part * lamps[5, k]
            blue += part * lamps[6, k]
        seen = np.exp(-t * setting[3])
        out[i, 0] += seen * colors[which, 0] * red
        out[i, 1] += seen * colors[which, 1] * green
        out[i, 2] += seen * colors[which, 2] * blue
