"""The kernel that composites tiles: blend records front to back, then put them over the backdrop.

Each pixel carries light C and transmittance T. A record with weight w and visible part V adds
C += T V w light, then T *= 1 - V w hidden (Porter and Duff 1984, the over operator, from the
front), for emission and cover alike. With c^2 = 1 - v^2 and F(t) = c^6 t - c^4 t^3 + 3 c^2 t^5 / 5
- t^7 / 7, the mean over a straight way of L radii of the weight (1 - r^2)^3 is exactly
w = (F(clamp(u, -c, c)) - F(clamp(u - L, -c, c))) / L, u along the way and v across it in radii.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from motes.jit import jit
from motes.renderer.project import SHORT, TILE

LANES = np.uint64(8)
"""Pixels of a row that are worked on at once; past its support a weight is exactly 0."""

OPAQUE = np.float32(1 / 4096)
"""A tile that transmits less everywhere is finished."""

# Unsigned, because an index that may be negative keeps a loop from becoming SIMD.
_UNIT = np.uint64(1)
_STRIDE = np.uint64(TILE) + LANES
_PLANE = _STRIDE * np.uint64(TILE)
_GREEN, _BLUE, _CLEAR = _PLANE, np.uint64(2) * _PLANE, np.uint64(3) * _PLANE
_ZERO = np.float32(0)
_ONE = np.float32(1)
_HALF = np.float32(0.5)
_HARD = np.float32(1e20)
_FAR = np.float32(np.inf)
_THREE_FIFTHS = np.float32(3 / 5)
_SEVENTH = np.float32(1 / 7)
_LAST = np.float32(TILE - 1)


@jit(inline=True)
def _streak(u: Any, v: Any, way: Any) -> Any:
    """Mean weight times `way` at u along and v across a straight way of `way` radii."""
    cc = max(_ONE - v * v, _ZERO)
    c = np.float32(math.sqrt(cc))
    s = min(max(u, -c), c)
    t = min(max(u - way, -c), c)
    ss, tt, c4 = s * s, t * t, cc * cc
    s *= cc * c4 + ss * (ss * (_THREE_FIFTHS * cc - ss * _SEVENTH) - c4)
    t *= cc * c4 + tt * (tt * (_THREE_FIFTHS * cc - tt * _SEVENTH) - c4)
    return max(s - t, _ZERO)  # Rounding must not take light away.


@jit
def composite(
    first_tile: Any,
    last_tile: Any,
    across: Any,
    starts: Any,
    order: Any,
    records: Any,
    depth: Any,
    edge: Any,
    samples: Any,
    bounds: Any,
    backdrop: Any,
    fresh: Any,
    final: Any,
    image: Any,
) -> None:
    """Composite the tiles [first_tile, last_tile) of an image (h, w, 4).

    records holds the rows starts[tile] to starts[tile + 1] of each tile, and order the same rows
    from near to far; it is empty where nothing hides anything. depth (h, w) is the distance of
    solids along the axis, or (0, 0) without any; edge (h, w) is the row of `samples` (e, 4) of a
    pixel on a silhouette, or -1; bounds (tiles, 2) is the least and greatest depth in each tile, or
    (0, 2). image and backdrop come as rows of 4 w numbers. A fresh image starts clear, one that is
    not holds C and T of nearer records; a final one is put over the backdrop and gets the alpha
    channel in place of T.
    """
    buffer = np.empty(_CLEAR + _PLANE, np.float32)
    weight, ramp = np.empty(_STRIDE, np.float32), np.empty(_STRIDE, np.float32)
    for a in range(ramp.size):
        ramp[a] = np.float32(a)  # Read below, since no SIMD instruction makes floats of counts.
    wide = records.shape[1] > 8
    for tile in range(first_tile, last_tile):
        left, top = tile % across * TILE, tile // across * TILE
        columns, rows = min(TILE, image.shape[1] // 4 - left), min(TILE, image.shape[0] - top)
        buffer[:_CLEAR] = _ZERO
        buffer[_CLEAR:] = _ONE
        if not fresh:
            for b in range(rows):
                for a in range(columns):
                    for k in range(4):
                        at = np.uint64(k) * _PLANE + np.uint64(b) * _STRIDE + np.uint64(a)
                        buffer[at] = image[top + b, 4 * (left + a) + k]
        closest, deepest = _FAR, _FAR
        if bounds.shape[0] > 0:
            closest, deepest = bounds[tile, 0], bounds[tile, 1]
        for rank in range(starts[tile], starts[tile + 1]):
            i = np.int64(order[rank]) if order.shape[0] > 0 else rank
            radius, inverse = records[i, 2], records[i, 3]
            x = records[i, 0] - np.float32(left) - _HALF
            y = records[i, 1] - np.float32(top) - _HALF
            red, green, blue, hidden = records[i, 4], records[i, 5], records[i, 6], records[i, 7]
            dx, dy, change, per_softness = _ZERO, _ZERO, _ZERO, _HARD
            if wide:
                dx, dy = records[i, 8], records[i, 9]
                change, per_softness = records[i, 10], records[i, 11]
            near = max(inverse, inverse + change)
            if deepest * near <= _ONE:
                continue
            tested = _ONE + near / per_softness > closest * (near - abs(change))
            scale = _ONE / radius
            # One that stands still moves a little to both sides of its place.
            ux, uy, way = _ONE, _ZERO, SHORT
            start, stop = x - radius, x + radius
            slope, reach = _ZERO, _ZERO
            offset = _HALF * SHORT
            if dx != _ZERO or dy != _ZERO:
                length = np.float32(math.sqrt(dx * dx + dy * dy))
                ux, uy, way, offset = dx / length, dy / length, length * scale, _ZERO
                start, stop = min(start, start + dx), max(stop, stop + dx)
                if abs(uy) > np.float32(0.01):
                    slope, reach = ux / uy, radius / abs(uy)
            plain = way == SHORT and not tested
            per_way = _ONE / way
            along_step, aside_step = scale * ux, scale * uy
            lowest = max(min(y, y + dy) - radius + _ONE, _ZERO)
            highest = min(max(y, y + dy) + radius, _LAST)
            for b in range(np.uint64(lowest), np.uint64(highest) + _UNIT):
                from_y = np.float32(b) - y
                begin, end = start, stop
                if reach > _ZERO:
                    # Only between the two sides of the streak.
                    middle = x + from_y * slope
                    begin, end = max(start, middle - reach), min(stop, middle + reach)
                begin, end = max(begin + _ONE, _ZERO), min(end, _LAST)
                if end < _ZERO or np.uint64(end) < np.uint64(begin):
                    continue
                first = np.uint64(begin)
                n = ((np.uint64(end) - first) // LANES + _UNIT) * LANES
                from_x = (np.float32(first) - x) * scale
                from_y *= scale
                at = b * _STRIDE + first
                if plain:
                    # The common case in one loop: the mean over no way at all.
                    rest = _ONE - from_y * from_y
                    for a in range(n):
                        u = from_x + ramp[a] * scale
                        w = max(rest - u * u, _ZERO)
                        w *= w * w * buffer[at + _CLEAR + a]
                        buffer[at + a] += w * red
                        buffer[at + _GREEN + a] += w * green
                        buffer[at + _BLUE + a] += w * blue
                        buffer[at + _CLEAR + a] -= w * hidden
                    continue
                along, aside = from_x * ux + from_y * uy + offset, from_y * ux - from_x * uy
                for a in range(n):
                    part = ramp[a]
                    w = _streak(along + part * along_step, aside - part * aside_step, way)
                    weight[a] = w * per_way
                if tested:
                    py = min(top + np.int64(b), image.shape[0] - 1)
                    for a in range(min(np.int64(n), columns - np.int64(first))):
                        part = min(max((along + np.float32(a) * along_step) / way, _ZERO), _ONE)
                        z = _ONE / (inverse + change * part)
                        px = left + np.int64(first) + a
                        row = edge[py, px]
                        many = 4 if row >= 0 else 1
                        visible = _ZERO
                        for k in range(many):
                            d = samples[row, k] if row >= 0 else depth[py, px]
                            visible += min(max((d - z) * per_softness, _ZERO), _ONE)
                        weight[a] *= visible / np.float32(many)
                for a in range(n):
                    w = weight[a] * buffer[at + _CLEAR + a]
                    buffer[at + a] += w * red
                    buffer[at + _GREEN + a] += w * green
                    buffer[at + _BLUE + a] += w * blue
                    buffer[at + _CLEAR + a] -= w * hidden
            if rank & 127 == 127:
                clearest = _ZERO
                for b in range(np.uint64(rows)):
                    for a in range(np.uint64(columns)):
                        clearest = max(clearest, buffer[_CLEAR + b * _STRIDE + a])
                if clearest < OPAQUE:
                    break
        for b in range(rows):
            line = buffer[np.int64(b) * np.int64(_STRIDE) :]
            red_of, green_of, blue_of = line[:columns], line[_GREEN:], line[_BLUE:]
            clear_of = line[_CLEAR:]
            shown = image[top + b, 4 * left : 4 * (left + columns)]
            under = backdrop[top + b, 4 * left : 4 * (left + columns)]
            for a in range(columns):
                clear, place = clear_of[a], 4 * a
                behind = clear if final else _ZERO
                shown[place] = red_of[a] + behind * under[place]
                shown[place + 1] = green_of[a] + behind * under[place + 1]
                shown[place + 2] = blue_of[a] + behind * under[place + 2]
                shown[place + 3] = _ONE - clear * (_ONE - under[place + 3]) if final else clear
