"""Order of particles along Morton's curve: neighbours in the order are neighbours in space."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.nearly import is_promising, merged, probes, remember, remembered
from motes.jit import blocks, jit, share

LEVELS = 21
"""Levels of an octree that fit into a key: bits for each of x, y, z."""

_BITS = 11
_ROWS = 1 << 16
"""Rows of a block, at most BLOCKS of them."""

_BLOCKS = 16

WORTH = range(1 << 14, 1 << 18)
"""Numbers of particles for which the last order is worth a try: of more, reading their places in
that order misses the caches and takes as long as sorting."""


@jit(inline=True)
def _spaced(value: Any) -> Any:
    """Bits of a number of 21 bits, three apart."""
    v = np.uint64(value)
    v = (v | (v << np.uint64(32))) & np.uint64(0x001F00000000FFFF)
    v = (v | (v << np.uint64(16))) & np.uint64(0x001F0000FF0000FF)
    v = (v | (v << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    v = (v | (v << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (v | (v << np.uint64(2))) & np.uint64(0x1249249249249249)


@jit(inline=True)
def _key(position: Any, low: Any, scale: Any, k: Any) -> Any:
    x = _spaced((position[k, 0] - low[0]) * scale)
    y = _spaced((position[k, 1] - low[1]) * scale)
    z = _spaced((position[k, 2] - low[2]) * scale)
    return (x << np.uint64(2)) | (y << np.uint64(1)) | z


@jit(numba=False)
def _write_keys(position: Any, low: Any, scale: Any, key: Any, order: Any, first: Any) -> None:
    for i in range(key.size):
        key[i] = _key(position, low, scale, first + i)
        order[i] = first + i


@jit(numba=False)
def _write_keys_of(
    position: Any, low: Any, scale: Any, rows: Any, key: Any, first: Any, last: Any
) -> None:
    for i in range(first, last):
        key[i] = _key(position, low, scale, rows[i])


@jit(numba=False)
def _count(key: Any, shift: Any, histogram: Any) -> None:
    histogram[:] = 0
    for i in range(key.size):
        histogram[np.intp((key[i] >> shift) & np.uint64(histogram.size - 1))] += 1


@jit(numba=False)
def _accumulate(histograms: Any) -> None:
    total = 0
    for digit in range(histograms.shape[1]):
        for block in range(histograms.shape[0]):
            count = histograms[block, digit]
            histograms[block, digit] = total
            total += count


@jit(numba=False)
def _scatter(key: Any, order: Any, shift: Any, place: Any, new_key: Any, new_order: Any) -> None:
    for i in range(key.size):
        digit = np.intp((key[i] >> shift) & np.uint64(place.size - 1))
        new_key[place[digit]] = key[i]
        new_order[place[digit]] = order[i]
        place[digit] += 1


def morton_order(
    position: NDArray[Any], low: NDArray[np.float64], size: float
) -> tuple[NDArray[np.uint64], NDArray[np.uint32]]:
    """Sorted keys and the order that sorts, of positions (n, 3) in a cube at `low`.

    A stable radix sort; equal keys keep the order of rows. Where the last order of as many
    particles is nearly right still, it is mended instead.
    """
    scale = (1 << LEVELS) / size * (1 - 2.0**-40)
    found = _again(position, low, scale) or _sorted(position, low, scale)
    if len(position) in WORTH:
        remember(found[1])
    return found


def _again(
    position: NDArray[Any], low: NDArray[np.float64], scale: float
) -> tuple[NDArray[np.uint64], NDArray[np.uint32]] | None:
    """The same from the last order of as many particles, if they moved little."""
    last = remembered(len(position))
    if last is None or len(last) not in WORTH:
        return None

    def keys(rows: NDArray[np.uint32]) -> NDArray[np.uint64]:
        key, ranges = np.empty(len(rows), np.uint64), blocks(len(rows), _ROWS)
        share(lambda k: _write_keys_of(position, low, scale, rows, key, *ranges[k]), len(ranges))
        return key

    return merged(keys(last), last.copy()) if is_promising(keys(probes(last))) else None


def _sorted(
    position: NDArray[Any], low: NDArray[np.float64], scale: float
) -> tuple[NDArray[np.uint64], NDArray[np.uint32]]:
    n = len(position)
    parts = min(max(n // _ROWS, 2), _BLOCKS)
    cuts = [n * block // parts for block in range(parts + 1)]
    key, order = np.empty(n, np.uint64), np.empty(n, np.uint32)
    new_key, new_order = np.empty_like(key), np.empty_like(order)
    histograms = np.empty((parts, 1 << _BITS), np.uint32)

    def write(block: int) -> None:
        rows = slice(cuts[block], cuts[block + 1])
        _write_keys(position, low, scale, key[rows], order[rows], cuts[block])

    share(write, parts)
    for bit in range(0, 3 * LEVELS, _BITS):
        shift = np.uint64(bit)

        def count(block: int, key: Any = key, shift: Any = shift) -> None:
            _count(key[cuts[block] : cuts[block + 1]], shift, histograms[block])

        share(count, parts)
        if histograms.sum(axis=0).max() == n:
            continue
        _accumulate(histograms)

        def scatter(
            block: int,
            old: Any = (key, order),
            new: Any = (new_key, new_order),
            shift: Any = shift,
        ) -> None:
            rows = slice(cuts[block], cuts[block + 1])
            _scatter(old[0][rows], old[1][rows], shift, histograms[block], *new)

        share(scatter, parts)
        key, order, new_key, new_order = new_key, new_order, key, order
    return key, order
