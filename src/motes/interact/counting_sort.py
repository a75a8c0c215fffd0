"""Stable order of rows by an integer key: counting sort, one digit after another."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share

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
