"""The order in which the records of a tile cover each other: from near to far."""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import jit

_HALF = np.float32(0.5)
_DIGIT = np.uint32(255)
_BITS = np.uint32(8)


@jit
def sort_tiles(first_tile: Any, last_tile: Any, starts: Any, records: Any, order: Any) -> None:
    """Write the rows of each tile by falling 1/z at mid-shutter; equal ones stay as they are.

    The pattern of a positive float grows evenly within each octave. Of the bits that vary in a tile
    the upper 16 are the key, sorted by two rounds of counting (radix sort from the last digit).
    """
    wide = records.shape[1] > 8
    longest = 0
    for tile in range(first_tile, last_tile):
        longest = max(longest, starts[tile + 1] - starts[tile])
    keys, places = np.empty(longest, np.uint32), np.empty(longest, np.uint32)
    counts = np.empty(256, np.uint32)
    for tile in range(first_tile, last_tile):
        low, many = starts[tile], starts[tile + 1] - starts[tile]
        most, least = np.uint32(0), np.uint32(0xFFFFFFFF)
        for i in range(many):
            inverse = records[low + i, 3]
            if wide:
                inverse += _HALF * records[low + i, 10]
            keys[i] = np.float32(inverse).view(np.uint32)
            most, least = max(most, keys[i]), min(least, keys[i])
        shift = np.uint32(0)
        while many > 0 and (most - least) >> shift > np.uint32(0xFFFF):
            shift += np.uint32(1)
        for i in range(many):
            keys[i] = (most - keys[i]) >> shift
        for second in range(2):
            digit = _BITS if second else np.uint32(0)
            counts[:] = 0
            for i in range(many):
                counts[(keys[i] >> digit) & _DIGIT] += np.uint32(1)
            below = np.uint32(0)
            for value in range(256):
                below, counts[value] = below + counts[value], below
            for i in range(many):
                row = places[i] if second else np.uint32(i)
                value = (keys[row] >> digit) & _DIGIT
                if second:
                    order[low + counts[value]] = low + row
                else:
                    places[counts[value]] = row
                counts[value] += np.uint32(1)
