"""Smallest, largest and sum of many numbers, by columns, read once."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.lanes import LANES, maximum, minimum, read, spread, write
from motes.jit import EXACT, each, jit

WINDOW = 3 * LANES
"""Numbers that are read together: as many of each column of one or three."""

BLOCK = WINDOW << 10
"""Numbers that one thread takes at a time."""


def of_columns(
    table: NDArray[Any],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Smallest numbers, largest, and sums (c,) of the columns of a table (n, c), c = 1 or 3.

    Where there are numbers that are not finite, so are the sums. No rows: (inf, -inf, 0).
    """
    columns = table.shape[1]
    if table.flags.c_contiguous:
        return _of_mixed(table.reshape(-1), columns)
    found = [_of_mixed(np.ascontiguousarray(column), 1) for column in table.T]
    low, high, sums = (np.concatenate(part) for part in zip(*found, strict=True))
    return low, high, sums


def _of_mixed(
    numbers: NDArray[Any], columns: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The same of numbers (n c,), row by row."""
    whole = numbers.size // WINDOW * WINDOW
    tails = [(first, min(first + BLOCK, whole)) for first in range(0, whole, BLOCK)]
    found = np.empty((len(tails), 3, WINDOW))
    each(_measure, (numbers, found), [(first, last, first // BLOCK) for first, last in tails])
    with np.errstate(all="ignore"):
        rest = numbers[whole:].astype(np.float64).reshape(-1, columns)
        parts = [np.concatenate([p.reshape(-1, columns), rest]) for p in np.moveaxis(found, 1, 0)]
        low, high = parts[0].min(axis=0, initial=np.inf), parts[1].max(axis=0, initial=-np.inf)
        return low, high, parts[2].sum(axis=0)


@jit(flags=EXACT, numba=False)
def _measure(numbers: Any, found: Any, first: Any, last: Any, block: Any) -> None:
    """Smallest, largest and sum of numbers WINDOW apart, from `first` to `last`."""
    low, high, sums = found[block, 0], found[block, 1], found[block, 2]
    a, b, c = read(numbers, first), read(numbers, first + LANES), read(numbers, first + 2 * LANES)
    low_a, low_b, low_c = a, b, c
    high_a, high_b, high_c = a, b, c
    sum_a, sum_b, sum_c = spread(0.0) + a, spread(0.0) + b, spread(0.0) + c
    for i in range(first + WINDOW, last, WINDOW):
        a, b, c = read(numbers, i), read(numbers, i + LANES), read(numbers, i + 2 * LANES)
        low_a, low_b, low_c = minimum(a, low_a), minimum(b, low_b), minimum(c, low_c)
        high_a, high_b, high_c = maximum(a, high_a), maximum(b, high_b), maximum(c, high_c)
        sum_a, sum_b, sum_c = sum_a + a, sum_b + b, sum_c + c
    write(low, 0, low_a)
    write(low, LANES, low_b)
    write(low, 2 * LANES, low_c)
    write(high, 0, high_a)
    write(high, LANES, high_b)
    write(high, 2 * LANES, high_c)
    write(sums, 0, sum_a)
    write(sums, LANES, sum_b)
    write(sums, 2 * LANES, sum_c)
