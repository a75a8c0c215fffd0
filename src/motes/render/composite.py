"""The kernel that composites a tile: sort its records, blend them front to back, add the backdrop.

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
from motes.render.project import TILE

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
def _sort(records: Any, key: Any, order: Any) -> None:
    """Fill order with the rows from near to far; equal depths keep their order.

    Two passes of a radix sort on the upper 16 bits that vary in the pattern of the float 1/z,
    which divides each octave of depth evenly.
    """
    n = np.uint64(records.shape[0])
    nearest, farthest = np.uint32(0), np.uint32(0xFFFFFFFF)
    wide = records.shape[1] > 8
    for q in range(n):
        inverse = records[q, 3]
        if wide:
            inverse += _HALF * records[q, 10]
        bits = np.float32(inverse).view(np.uint32)
        key[0, q] = bits
        nearest, farthest = max(nearest, bits), min(farthest, bits)
    shift = np.uint32(0)
    while ((nearest - farthest) >> shift) > np.uint32(65535):
        shift += np.uint32(1)
    count = np.zeros(514, np.uint32)
    for q in range(n):
        bits = (nearest - key[0, q]) >> shift
        key[0, q] = bits
        count[(bits & np.uint32(255)) + np.uint32(1)] += np.uint32(1)
        count[(bits >> np.uint32(8)) + np.uint32(258)] += np.uint32(1)
    for digit in range(256):
        count[digit + 1] += count[digit]
        count[digit + 258] += count[digit + 257]
    for q in range(n):
        digit = key[0, q] & np.uint32(255)
        place = count[digit]
        count[digit] = place + np.uint32(1)
        key[1, place] = np.uint32(q)
    for q in range(n):
        row = key[1, q]
        digit = (key[0, row] >> np.uint32(8)) + np.uint32(257)
        place = count[digit]
        count[digit] = place + np.uint32(1)
        order[place] = row


@jit(inline=True)
def _still_row(weight: Any, n: Any, x: Any, scale: Any, rest: Any) -> None:
    """Weights of n pixels at x, x + 1, ...; rest is 1 - v^2 of the row."""
    for a in range(n):
        u = (x + np.float32(a)) * scale
        w = max(rest - u * u, _ZERO)
        weight[a] = w * w * w


@jit(inline=True)
def _streak_row(
    weight: Any, n: Any, x: Any, scale: Any, y: Any, ux: Any, uy: Any, way: Any
) -> None:
    """Mean weights of n pixels at x, x + 1, ... and y, for a way in radii along (ux, uy)."""
    per_way = _ONE / way
    for a in range(n):
        px = (x + np.float32(a)) * scale
        u = px * ux + y * uy
        v = y * ux - px * uy
        cc = max(_ONE - v * v, _ZERO)
        c = np.float32(math.sqrt(cc))
        s = min(max(u, -c), c)
        t = min(max(u - way, -c), c)
        ss, tt, c4 = s * s, t * t, cc * cc
        s *= cc * c4 + ss * (ss * (_THREE_FIFTHS * cc - ss * _SEVENTH) - c4)
        t *= cc * c4 + tt * (tt * (_THREE_FIFTHS * cc - tt * _SEVENTH) - c4)
        weight[a] = (s - t) * per_way


@jit(inline=True)
def _blend_row(
    buffer: Any, at: Any, weight: Any, n: Any, red: Any, green: Any, blue: Any, hidden: Any
) -> None:
    for a in range(n):
        w = weight[a] * buffer[at + _CLEAR + a]
        buffer[at + a] += w * red
        buffer[at + _GREEN + a] += w * green
        buffer[at + _BLUE + a] += w * blue
        buffer[at + _CLEAR + a] -= w * hidden


@jit(inline=True)
def _hide_row(
    weight: Any,
    n: Any,
    along: Any,
    step: Any,
    inverse: Any,
    change: Any,
    per_softness: Any,
    depth: Any,
    edge: Any,
    samples: Any,
) -> None:
    """Multiply weights by the part of each pixel in which the record lies before the solids.

    along is the place on the streak of the first pixel, 0 to 1 from end to end, and step its
    change per pixel; depth and edge are the row of pixels.
    """
    for a in range(min(n, np.uint64(depth.size))):
        z = _ONE / (inverse + change * min(max(along + step * np.float32(a), _ZERO), _ONE))
        row = edge[a]
        if row < 0:
            weight[a] *= min(max((depth[a] - z) * per_softness, _ZERO), _ONE)
            continue
        part = _ZERO
        for k in range(4):
            part += min(max((samples[row, k] - z) * per_softness, _ZERO), _ONE)
        weight[a] *= part * np.float32(0.25)


@jit(inline=True)
def _draw(
    record: Any,
    left: Any,
    top: Any,
    buffer: Any,
    weight: Any,
    closest: Any,
    deepest: Any,
    depth: Any,
    edge: Any,
    samples: Any,
) -> None:
    """Blend one record into the tile at (left, top), whose solids lie at closest to deepest."""
    radius = record[2]
    x = record[0] - np.float32(left) - _HALF
    y = record[1] - np.float32(top) - _HALF
    inverse = record[3]
    dx, dy, change, per_softness = _ZERO, _ZERO, _ZERO, _HARD
    if record.size > 8:
        dx, dy, change, per_softness = record[8], record[9], record[10], record[11]
    other = inverse + change
    if deepest * max(inverse, other) <= _ONE:
        return
    tested = _ONE / min(inverse, other) + _ONE / per_softness > closest
    scale = _ONE / radius
    length = np.float32(math.sqrt(dx * dx + dy * dy))
    still = length == _ZERO
    way = length * scale
    ux, uy = _ONE, _ZERO
    if not still:
        ux, uy = dx / length, dy / length
    start, stop = min(x, x + dx) - radius, max(x, x + dx) + radius
    lowest, highest = min(y, y + dy) - radius + _ONE, max(y, y + dy) + radius
    steep = abs(uy) > np.float32(0.01)
    for b in range(np.uint64(max(lowest, _ZERO)), np.uint64(min(highest, _LAST)) + _UNIT):
        from_y = np.float32(b) - y
        begin, end = start, stop
        if steep:
            # Only between the two sides of the streak.
            middle, reach = x + from_y * ux / uy, radius / abs(uy)
            begin, end = max(start, middle - reach), min(stop, middle + reach)
        if end < _ZERO or begin >= _LAST:
            continue
        first = np.uint64(max(begin + _ONE, _ZERO))
        last = np.uint64(min(end, _LAST))
        if last < first:
            continue
        n = ((last - first) // LANES + _UNIT) * LANES
        from_x = np.float32(first) - x
        from_y *= scale
        if still:
            _still_row(weight, n, from_x, scale, _ONE - from_y * from_y)
        else:
            _streak_row(weight, n, from_x, scale, from_y, ux, uy, way)
        if tested:
            along, step = _ZERO, _ZERO
            if not still:
                step = ux / length
                along = from_x * step + from_y * radius * uy / length
            row = min(np.int64(top) + np.int64(b), depth.shape[0] - 1)
            pixel = np.int64(left) + np.int64(first)
            _hide_row(
                weight,
                n,
                along,
                step,
                inverse,
                change,
                per_softness,
                depth[row, pixel:],
                edge[row, pixel:],
                samples,
            )
        at = b * _STRIDE + first
        _blend_row(buffer, at, weight, n, record[4], record[5], record[6], record[7])


@jit(inline=True)
def _range_of_solids(depth: Any, edge: Any, samples: Any) -> Any:
    """Nearest and farthest depth in a tile; infinite where there are no solids."""
    if depth.size == 0:
        return _FAR, _FAR
    closest, deepest = _FAR, _ZERO
    for b in range(depth.shape[0]):
        for a in range(depth.shape[1]):
            closest, deepest = min(closest, depth[b, a]), max(deepest, depth[b, a])
            row = edge[b, a]
            if row >= 0:
                for k in range(4):
                    closest = min(closest, samples[row, k])
                    deepest = max(deepest, samples[row, k])
    return closest, deepest


@jit(inline=True)
def _load(buffer: Any, image: Any, fresh: Any) -> None:
    """Fill the planes of the buffer with what the tile holds so far."""
    for i in range(_CLEAR):
        buffer[i] = _ZERO
    for i in range(_CLEAR, _CLEAR + _PLANE):
        buffer[i] = _ONE
    if not fresh:
        for b in range(image.shape[0]):
            for a in range(image.shape[1]):
                for k in range(4):
                    plane = np.uint64(k) * _PLANE
                    buffer[plane + np.uint64(b) * _STRIDE + np.uint64(a)] = image[b, a, k]


@jit(inline=True)
def _store(buffer: Any, image: Any, backdrop: Any, final: Any) -> None:
    for b in range(image.shape[0]):
        for a in range(image.shape[1]):
            at = np.uint64(b) * _STRIDE + np.uint64(a)
            clear = buffer[at + _CLEAR]
            behind = clear if final else _ZERO
            image[b, a, 0] = buffer[at] + behind * backdrop[b, a, 0]
            image[b, a, 1] = buffer[at + _GREEN] + behind * backdrop[b, a, 1]
            image[b, a, 2] = buffer[at + _BLUE] + behind * backdrop[b, a, 2]
            image[b, a, 3] = _ONE - clear * (_ONE - backdrop[b, a, 3]) if final else clear


@jit(inline=True)
def _opaque(buffer: Any, width: Any, height: Any) -> Any:
    """Whether the tile hides everything that follows."""
    clearest = _ZERO
    for b in range(np.uint64(height)):
        for a in range(np.uint64(width)):
            clearest = max(clearest, buffer[_CLEAR + b * _STRIDE + a])
    return clearest < OPAQUE


@jit
def composite(
    first_tile: Any,
    last_tile: Any,
    across: Any,
    starts: Any,
    records: Any,
    depth: Any,
    edge: Any,
    samples: Any,
    backdrop: Any,
    fresh: Any,
    final: Any,
    image: Any,
) -> None:
    """Composite the tiles [first_tile, last_tile) of image (h, w, 4).

    depth (h, w) is the distance of solids along the axis, or (0, 0) without any; edge (h, w) is
    the row of `samples` (e, 4) of a pixel on a silhouette, or -1. A fresh image starts clear, one
    that is not holds C and T of nearer records; a final one is put over the backdrop and gets
    T replaced by the alpha channel.
    """
    longest = 1
    for tile in range(first_tile, last_tile):
        longest = max(longest, starts[tile + 1] - starts[tile])
    key = np.empty((2, longest), np.uint32)
    order = np.empty(longest, np.uint32)
    buffer = np.empty(_CLEAR + _PLANE, np.float32)
    weight = np.empty(_STRIDE, np.float32)
    for tile in range(first_tile, last_tile):
        left, top = (tile % across) * TILE, (tile // across) * TILE
        low, high = starts[tile], starts[tile + 1]
        pixels = image[top : top + TILE, left : left + TILE]
        behind = backdrop[top : top + TILE, left : left + TILE]
        _load(buffer, pixels, fresh)
        if high > low:
            _sort(records[low:high], key, order)
            closest, deepest = _range_of_solids(
                depth[top : top + TILE, left : left + TILE],
                edge[top : top + TILE, left : left + TILE],
                samples,
            )
            for q in range(high - low):
                record = records[low + np.int64(order[q])]
                _draw(record, left, top, buffer, weight, closest, deepest, depth, edge, samples)
                if q & 127 == 127 and _opaque(buffer, pixels.shape[1], pixels.shape[0]):
                    break
        _store(buffer, pixels, behind, final)
