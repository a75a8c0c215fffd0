"""Stable order of rows by an integer key: counting sort, of the whole key or of its digits."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share

Room = dict[str, NDArray[Any]]
"""Arrays by what they are for, which serve again where they are large enough."""


def room_for(room: Room | None, name: str, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """An array whose numbers are not set, from a room if there is one."""
    size, kind = math.prod(shape), np.dtype(dtype)
    if room is None:
        return np.empty(shape, kind)
    kept = room.get(name)
    if kept is None or kept.size < size or kept.dtype != kind:
        kept = room[name] = np.empty(size + size // 8, kind)
    return kept[:size].reshape(shape)


DIGIT = 11
"""Most bits that one pass sorts by: its counters fit the first cache."""

_BLOCKS = 16
_SMALLEST = 1 << 15


@jit
def _count(key: Any, shift: Any, counts: Any) -> None:
    mask = np.uint64(counts.size - 1)
    for i in range(key.size):
        counts[np.intp((key[i] >> shift) & mask)] += 1


@jit
def _scatter(key: Any, row: Any, shift: Any, place: Any, new_key: Any, new_row: Any) -> None:
    mask = np.uint64(place.size - 1)
    for i in range(key.size):
        digit = np.intp((key[i] >> shift) & mask)
        new_key[place[digit]] = key[i]
        new_row[place[digit]] = row[i]
        place[digit] += 1


def sorted_rows(key: NDArray[np.uint64], bits: int) -> tuple[NDArray[np.uint64], NDArray[np.int32]]:
    """Keys (n,) of `bits` bits in rising order, and the rows (n,) that they come from.

    Equal keys keep the order of their rows.
    """
    n = len(key)
    row = np.arange(n, dtype=np.int32)
    passes = -(-bits // DIGIT)
    if n == 0 or passes == 0:
        return key, row
    digit = -(-bits // passes)
    parts = blocks(n, max(_SMALLEST, -(-n // _BLOCKS)))
    new_key, new_row = np.empty_like(key), np.empty_like(row)
    for number in range(passes):
        shift = np.uint64(number * digit)
        counts = np.zeros((len(parts), 1 << digit), np.int64)

        def count(
            part: int, key: Any = key, shift: Any = shift, counts: NDArray[np.int64] = counts
        ) -> None:
            _count(key[slice(*parts[part])], shift, counts[part])

        share(count, len(parts))
        ends = np.cumsum(counts.T).reshape(counts.T.shape).T
        places = np.ascontiguousarray(ends - counts)

        def scatter(
            part: int,
            old: Any = (key, row),
            new: Any = (new_key, new_row),
            shift: Any = shift,
            places: NDArray[np.int64] = places,
        ) -> None:
            rows = slice(*parts[part])
            _scatter(old[0][rows], old[1][rows], shift, places[part], *new)

        share(scatter, len(parts))
        key, row, new_key, new_row = new_key, new_row, key, row
    return key, row


FEWEST = 1 << 15
"""Rows that are counted in one part, where a second thread would cost more than it brings."""

HALVES = 2
"""Parts of the rows that are counted by themselves where the key is not cut into digits: each has
as many counters as there are keys."""


@jit
def _starts(counts: Any, first: Any) -> None:
    """From how many rows of each part have a key to where the first of them goes."""
    place = np.int32(0)
    for k in range(counts.shape[1]):
        first[k] = place
        for part in range(counts.shape[0]):
            many = counts[part, k]
            counts[part, k] = place
            place += many
    first[counts.shape[1]] = place


@jit
def _put(key: Any, begin: Any, place: Any, new_key: Any, new_row: Any) -> None:
    for i in range(key.size):
        at = np.intp(place[key[i]])
        new_key[at] = key[i]
        new_row[at] = begin + i
        place[key[i]] += 1


@jit
def _count_all(key: Any, counts: Any) -> None:
    counts[:] = np.int32(0)
    for i in range(key.size):
        counts[key[i]] += 1


def counted_rows(
    key: NDArray[np.uint64], keys: int, room: Room | None = None
) -> tuple[NDArray[np.uint64], NDArray[np.int32], NDArray[np.int32]]:
    """`sorted_rows` for keys (n,) below `keys`, at most a few times n, and `first` (keys + 1,): how
    many rows have keys below each.

    Rows that are almost in order already are read and written almost in order. What is returned
    is in `room`, if one is given.
    """
    parts = blocks(len(key), max(FEWEST, -(-len(key) // HALVES)))
    counts = room_for(room, "counts", (len(parts), keys), np.int32)
    share(lambda part: _count_all(key[slice(*parts[part])], counts[part]), len(parts))
    first = room_for(room, "first", (keys + 1,), np.int32)
    _starts(counts, first)
    new_key = room_for(room, "new_key", key.shape, np.uint64)
    new_row = room_for(room, "row", key.shape, np.int32)

    def put(part: int) -> None:
        begin, end = parts[part]
        _put(key[begin:end], begin, counts[part], new_key, new_row)

    share(put, len(parts))
    return new_key, new_row, first
