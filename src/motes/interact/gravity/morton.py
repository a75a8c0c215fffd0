"""Order of particles along Morton's curve: neighbours in the order are neighbours in space.

Keys found in a sample cut all keys into ranges of as many particles, which fit a processor's second
cache. Particles are written to the ranges with all that is known of them, and each range is sorted
by itself: nothing is read twice from afar. Source: sample sort, Frazer and McKellar, Journal of the
ACM 17 (1970) 496; ranges are found as by Sanders and Winkel, Super scalar sample sort (2004).
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.room import Room
from motes.jit import EXACT, each, jit, share

LEVELS = 21
"""Levels of an octree that fit into a key: bits for each of x, y, z."""

_PART = 4096
"""Particles of a part, about, which are sorted together."""

_PARTS = 2048
"""Most parts: so many places are written to at once."""

_SAMPLE = 16
"""Keys of the sample for each part."""

_BLOCK, _BLOCKS = 1 << 14, 16
"""Rows of a block, and most blocks."""

_BITS = 10
"""Bits of a digit of keys."""

_FEW = 24
"""Keys that are sorted by insertion."""


class Sorted(NamedTuple):
    """Particles in Morton order."""

    key: NDArray[np.uint64]
    """(n,)"""
    order: NDArray[np.uint32]
    """(n,) row of each particle in the arrays that it came from; ascending where keys are equal."""
    place: NDArray[np.float64]
    """(4, n) x, y, z, m in units of the box."""


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
def _write_keys(position: Any, low: Any, scale: Any, step: Any, first: Any, key: Any) -> None:
    """Keys of every `step`-th row from `first` on."""
    for i in range(key.size):
        key[i] = _key(position, low, scale, first + i * step)


@jit(numba=False)
def _find_parts(key: Any, splitters: Any, steps: Any, part: Any, counts: Any) -> None:
    """Write the part of each key, and how many are in each.

    `splitters` (2^steps,) is a binary search tree: the root is row 1, children of k are 2 k and
    2 k + 1.
    """
    counts[:] = 0
    parts = np.uint32(splitters.size)
    for i in range(key.size):
        node = np.uint32(1)
        for _ in range(steps):
            node = node * np.uint32(2) + np.uint32(key[i] >= splitters[node])
        part[i] = node - parts
        counts[node - parts] += 1


@jit(flags=EXACT, numba=False)
def _scatter(
    points: Any, mass: Any, origin: Any, length: Any, unit: Any, key: Any, part: Any, first: Any,
    to: Any, body: Any, tag: Any,
) -> None:  # fmt: skip
    """Write rows from `first` on, (x, y, z, m) and (key, row), to their parts.

    Divided, as one over a unit may be infinite.
    """
    for i in range(key.size):
        k, at = first + i, to[part[i]]
        body[at, 0] = (points[k, 0] - origin[0]) / length
        body[at, 1] = (points[k, 1] - origin[1]) / length
        body[at, 2] = (points[k, 2] - origin[2]) / length
        body[at, 3] = mass[k] / unit
        tag[at, 4] = key[i]
        tag[at, 5] = np.uint64(k)
        to[part[i]] = at + 1


@jit(numba=False)
def _pass(key: Any, row: Any, shift: Any, counts: Any, new_key: Any, new_row: Any) -> None:
    """Sort by one digit, keeping the order where it is equal."""
    counts[:] = 0
    lowest = np.uint64(counts.size - 1)
    for i in range(key.size):
        counts[np.intp((key[i] >> shift) & lowest)] += 1
    place = 0
    for digit in range(counts.size):
        count = counts[digit]
        counts[digit] = place
        place += count
    for i in range(key.size):
        at = np.intp((key[i] >> shift) & lowest)
        new_key[counts[at]], new_row[counts[at]] = key[i], row[i]
        counts[at] += 1


@jit(numba=False)
def _sort(key: Any, row: Any, spare_key: Any, spare_row: Any, counts: Any) -> None:
    """Sort keys and what is with them: by the highest digits in which they differ, and where those
    are equal, which few are, by the rest."""
    differ, shift, two = np.uint64(0), np.uint64(0), np.uint64(2 * _BITS)
    for i in range(key.size):
        differ |= key[i] ^ key[0]
    while (differ >> shift) >> two != 0:
        shift += np.uint64(1)
    first, last, low, high = 0, key.size, shift, shift + two
    done = 0
    while True:
        some, rows, width = key[first:last], row[first:last], last - first
        while low < high:
            _pass(some, rows, low, counts, spare_key[:width], spare_row[:width])
            low += np.uint64(_BITS)
            _pass(spare_key[:width], spare_row[:width], low, counts, some, rows)
            low += np.uint64(_BITS)
        # The next of many keys whose highest digits are equal.
        first, last = done, done
        while shift > 0 and last - first <= _FEW and last < key.size:
            first, last = last, last + 1
            while last < key.size and key[last] >> shift == key[first] >> shift:
                last += 1
            if last - first <= _FEW:
                for i in range(first + 1, last):
                    k, r, at = key[i], row[i], i
                    while at > first and key[at - 1] > k:
                        key[at], row[at] = key[at - 1], row[at - 1]
                        at -= 1
                    key[at], row[at] = k, r
        if last - first <= _FEW:
            break
        done, low, high = last, np.uint64(0), shift


@jit(numba=False)
def _arrange(body: Any, tag: Any, start: Any, end: Any, key: Any, order: Any, place: Any) -> None:
    """Sort a part, from rows (x, y, z, m) and (key, row)."""
    size = end - start
    row, counts = np.empty(size, np.uint32), np.empty(1 << _BITS, np.uint32)
    spare_key, spare_row = np.empty(size, np.uint64), np.empty(size, np.uint32)
    for i in range(size):
        key[start + i], row[i] = tag[start + i, 4], start + i
    _sort(key[start:end], row, spare_key, spare_row, counts)
    for i in range(size):
        order[start + i] = tag[row[i], 5]
        for axis in range(4):
            place[axis, start + i] = body[row[i], axis]


@jit(numba=False)
def _arrange_parts(
    body: Any, tag: Any, starts: Any, key: Any, order: Any, place: Any, first: Any, last: Any
) -> None:
    for part in range(first, last):
        _arrange(body, tag, starts[part], starts[part + 1], key, order, place)


def morton_order(
    points: NDArray[Any],
    mass: NDArray[np.float64],
    low: NDArray[np.float64],
    size: float,
    origin: NDArray[np.float64],
    length: float,
    unit: float,
    room: Room,
) -> Sorted:
    """Points (n, 3) with masses (n,) in Morton order, in a cube of edge `size` with a corner `low`.

    Places are from `origin`; `length` and `unit` are what they and masses are measured in. The
    pieces "records" and "marks" of the room are free again afterwards.
    """
    n, scale = len(points), (1 << LEVELS) / size * (1 - 2.0**-40)
    steps = min(max(n // _PART, 1), _PARTS).bit_length() - 1
    parts, splitters = 1 << steps, _splitters(points, low, scale, steps)
    number = min(max(n // _BLOCK, 1), _BLOCKS)
    cuts = [n * block // number for block in range(number + 1)]
    key, order = room.array("key", (n,), np.uint64), room.array("order", (n,), np.uint32)
    part, counts = room.array("marks", (n,), np.uint16), np.empty((number, parts), np.uint32)

    def find(block: int) -> None:
        rows = slice(cuts[block], cuts[block + 1])
        _write_keys(points, low, scale, 1, cuts[block], key[rows])
        _find_parts(key[rows], splitters, steps, part[rows], counts[block])

    share(find, number)
    # Where each block begins to write to each part, after the blocks before it.
    sizes = counts.T.reshape(-1)
    ends = np.cumsum(sizes, dtype=np.int64)
    to = np.ascontiguousarray((ends - sizes).reshape(parts, number).T)
    starts = np.append(to[0], n)
    # Columns 0 to 3 are (x, y, z, m), 4 and 5 the key and the row, as integers.
    body = room.array("records", (n, 6))
    tag = body.view(np.uint64)

    def scatter(block: int) -> None:
        rows = slice(cuts[block], cuts[block + 1])
        _scatter(
            points, mass, origin, length, unit, key[rows], part[rows], cuts[block],
            to[block], body, tag,
        )  # fmt: skip

    share(scatter, number)
    place = room.columns("place", 4, n)
    width = max(parts // 64, 1)
    tails = [(first, min(first + width, parts)) for first in range(0, parts, width)]
    each(_arrange_parts, (body, tag, starts, key, order, place), tails)
    return Sorted(key, order, place)


def _splitters(
    points: NDArray[Any], low: NDArray[np.float64], scale: float, steps: int
) -> NDArray[np.uint64]:
    """Keys between 2^steps parts of about as many particles, as a binary search tree."""
    parts = 1 << steps
    tree = np.zeros(parts, np.uint64)
    if steps:
        sample = np.empty(_SAMPLE * parts, np.uint64)
        _write_keys(points, low, scale, len(points) // len(sample), 0, sample)
        sample.sort()
        between = sample[_SAMPLE::_SAMPLE]
        for level in range(steps):
            tree[1 << level : 2 << level] = between[(parts >> (level + 1)) - 1 :: parts >> level]
    return tree
