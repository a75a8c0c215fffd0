"""Kernels from particles to records: project them, and distribute them to tiles.

A record is one particle as a tile needs it, 8 numbers in one piece of memory:
x, y [pixels], R [pixels], 1/z [1/m], the light that it gives (red, green, blue) and the part that
it hides, both at the centre of the splat. Where anything moves or fades at solids, 4 more follow:
the way of x, y and 1/z over the shutter, and 1/softness.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from motes.jit import STRICT, jit

TILE = 32
"""Width and height of a tile [pixels]."""

FLOOR = np.float32(1.9)
"""Smallest radius drawn [pixels]: the energy of a triweight splat is then even within 2 %."""

SHORT = np.float32(0.02)
"""Length [radii] of what is drawn as still: of less, the closed form would cancel."""

_HALF = np.float32(0.5)
_ONE = np.float32(1)
_ZERO = np.float32(0)
_PER_TILE = np.float32(1 / TILE)
_TILE_REACH = np.float32(TILE * 0.7072)
_HUGE = np.float32(1e30)


@jit
def project(
    position: Any,
    velocity: Any,
    color: Any,
    size: Any,
    lit: Any,
    clip: Any,
    views: Any,
    lens: Any,
    moving: Any,
    records: Any,
) -> None:
    """Write one record per particle; R = -1 marks one that is not visible.

    views (2, 3, 4) are the cameras at both ends of the shutter. lens holds focal length, width and
    height [pixels], near, shutter [s], 1/softness, opacity, and per colour the light per alpha, to
    which lamps add `lit` (n, 3) times the opacity, if it has rows.
    """
    focal, width, height, near, shutter = lens[0], lens[1], lens[2], lens[3], lens[4]
    opacity = lens[6]
    for i in range(size.size):
        records[i, 2] = -_ONE
        for k in range(8, min(records.shape[1], 10)):
            records[i, k] = _ZERO
        px, py, pz = position[i, 0], position[i, 1], position[i, 2]
        alpha = color[i, 3]
        x0 = views[0, 0, 0] * px + views[0, 0, 1] * py + views[0, 0, 2] * pz + views[0, 0, 3]
        y0 = views[0, 1, 0] * px + views[0, 1, 1] * py + views[0, 1, 2] * pz + views[0, 1, 3]
        z0 = views[0, 2, 0] * px + views[0, 2, 1] * py + views[0, 2, 2] * pz + views[0, 2, 3]
        x1, y1, z1 = x0, y0, z0
        alive = _ONE
        if moving:
            px += velocity[i, 0] * shutter
            py += velocity[i, 1] * shutter
            pz += velocity[i, 2] * shutter
            x1 = views[1, 0, 0] * px + views[1, 0, 1] * py + views[1, 0, 2] * pz + views[1, 0, 3]
            y1 = views[1, 1, 0] * px + views[1, 1, 1] * py + views[1, 1, 2] * pz + views[1, 1, 3]
            z1 = views[1, 2, 0] * px + views[1, 2, 1] * py + views[1, 2, 2] * pz + views[1, 2, 3]
            first, last = _ZERO, _ONE
            if clip.shape[0] > 0:
                first = max(clip[i, 0], _ZERO)
                last = min(clip[i, 1], _ONE)
            # Of the way in front of the camera only.
            if z0 < near and z1 > near:
                first = max(first, (near - z0) / (z1 - z0))
            if z1 < near and z0 > near:
                last = min(last, (near - z0) / (z1 - z0))
            alive = last - first
            dx, dy, dz = x1 - x0, y1 - y0, z1 - z0
            x1, y1, z1 = x0 + last * dx, y0 + last * dy, z0 + last * dz
            x0, y0, z0 = x0 + first * dx, y0 + first * dy, z0 + first * dz
        sane = abs(x0) + abs(y0) + abs(x1) + abs(y1) + abs(z0) + abs(z1)
        sane += abs(color[i, 0]) + abs(color[i, 1]) + abs(color[i, 2]) + abs(alpha) + size[i]
        # The comparisons are written so that NaN fails them. Rounding may leave a clipped end
        # a little in front of the near plane.
        depth = min(z0, z1)
        if not (sane < _HUGE and alive > _ZERO and size[i] > _ZERO and depth > _HALF * near):
            continue
        i0 = _ONE / z0
        i1 = _ONE / z1
        sx = x0 * i0 * focal + width * _HALF
        sy = height * _HALF - y0 * i0 * focal
        dx = x1 * i1 * focal + width * _HALF - sx
        dy = height * _HALF - y1 * i1 * focal - sy
        radius = _HALF * size[i] * focal * _HALF * (i0 + i1)
        if radius < FLOOR:
            shrink = radius / FLOOR
            alive *= shrink * shrink
            radius = FLOOR
        hides = min(alpha * opacity, _ONE) * alive
        gives = alpha * alive
        if dx * dx + dy * dy < SHORT * SHORT * radius * radius:
            dx, dy = _ZERO, _ZERO
        left, right = min(sx, sx + dx) - radius, max(sx, sx + dx) + radius
        top, bottom = min(sy, sy + dy) - radius, max(sy, sy + dy) + radius
        if not (right > _ZERO and bottom > _ZERO and left < width and top < height):
            continue
        if gives == _ZERO or not radius < _HUGE:
            continue
        records[i, 0] = sx
        records[i, 1] = sy
        records[i, 2] = radius
        records[i, 3] = i0
        red, green, blue = lens[7], lens[8], lens[9]
        if lit.shape[0] > 0:
            red += opacity * lit[i, 0]
            green += opacity * lit[i, 1]
            blue += opacity * lit[i, 2]
        records[i, 4] = color[i, 0] * gives * red
        records[i, 5] = color[i, 1] * gives * green
        records[i, 6] = color[i, 2] * gives * blue
        records[i, 7] = hides
        if records.shape[1] > 8:
            records[i, 8] = dx
            records[i, 9] = dy
            records[i, 10] = i1 - i0
            records[i, 11] = lens[5]


@jit(flags=STRICT)
def distribute(records: Any, places: Any, across: Any, down: Any, packed: Any) -> None:
    """Copy each record to every tile that it touches, or with an empty `packed` only count.

    places is the next free row of each tile, or the count. Both passes are one kernel without
    reordered arithmetic, so that they agree on what touches a tile to the last bit.
    """
    width = records.shape[1]
    counting = packed.shape[0] == 0
    last_column, last_row = np.float32(across - 1), np.float32(down - 1)
    for i in range(records.shape[0]):
        radius = records[i, 2]
        if radius < _ZERO:
            continue
        x, y = records[i, 0], records[i, 1]
        dx, dy, ux, uy = _ZERO, _ZERO, _ZERO, _ZERO
        if width > 8:
            dx, dy = records[i, 8], records[i, 9]
            length = np.float32(math.sqrt(dx * dx + dy * dy))
            if length > _ZERO:
                ux, uy = dx / length, dy / length
        # In tiles, clipped to the picture before they become integers.
        left = max((min(x, x + dx) - radius) * _PER_TILE, _ZERO)
        right = min((max(x, x + dx) + radius) * _PER_TILE, last_column)
        top = max((min(y, y + dy) - radius) * _PER_TILE, _ZERO)
        bottom = min((max(y, y + dy) + radius) * _PER_TILE, last_row)
        reach = radius + _TILE_REACH
        for row in range(int(top), int(bottom) + 1):
            cy = np.float32(row * TILE + TILE // 2) - y
            for column in range(int(left), int(right) + 1):
                cx = np.float32(column * TILE + TILE // 2) - x
                if abs(cx * uy - cy * ux) > reach:
                    continue  # A slanted streak passes by.
                tile = row * across + column
                place = places[tile]
                places[tile] = place + 1
                if counting:
                    continue
                for k in range(8):
                    packed[place, k] = records[i, k]
                if width > 8:
                    for k in range(8, 12):
                        packed[place, k] = records[i, k]
