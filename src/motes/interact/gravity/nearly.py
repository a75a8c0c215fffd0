"""Sorting again what was sorted before and has moved little: cheaper, with the same result.

The order of keys, and of rows where keys are equal, is one and the same however it is found. What
is remembered here, the last order of so many particles, decides how long a sort takes and nothing
else. Source: Rohrer, drop-merge sort (2017): what is out of order is taken out, sorted, merged.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import jit

MOST_DROPPED = 8
"""One of so many particles may be out of order."""

PROBES = 256
"""Particles whose order tells whether the last one is worth a try."""

STUBBORN = 4
"""Dropped in a row, of which the one before is to blame, and dropped in their stead."""

KEPT = 2
"""Orders that are remembered."""

_last: dict[int, NDArray[np.uint32]] = {}


def remember(order: NDArray[np.uint32]) -> None:
    """Keep an order for the next sort of as many particles."""
    _last.pop(len(order), None)
    while len(_last) >= KEPT:
        _last.pop(next(iter(_last)))
    _last[len(order)] = order


def remembered(count: int) -> NDArray[np.uint32] | None:
    """The last order of so many particles."""
    return _last.get(count)


def probes(order: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Some rows, far from each other in an order."""
    return np.ascontiguousarray(order[:: max(len(order) // PROBES, 1)])


def is_promising(key: NDArray[np.uint64]) -> bool:
    """Whether keys of probes are nearly in order."""
    return bool((key[1:] < key[:-1]).sum() * MOST_DROPPED <= len(key))


def merged(
    key: NDArray[np.uint64], order: NDArray[np.uint32]
) -> tuple[NDArray[np.uint64], NDArray[np.uint32]] | None:
    """Keys and rows sorted, by key and then by row; None if too many are out of order."""
    room = len(key) // MOST_DROPPED + STUBBORN
    lost_key, lost_order = np.empty(room, np.uint64), np.empty(room, np.uint32)
    kept, lost = _drop(key, order, lost_key, lost_order)
    if lost < 0:
        return None
    again = np.lexsort((lost_order[:lost], lost_key[:lost]))
    _merge(key, order, kept, lost_key[again], lost_order[again])
    return key, order


@jit(numba=False)
def _drop(key: Any, order: Any, lost_key: Any, lost_order: Any) -> Any:
    """Move what ascends to the front, the rest to other arrays; how many these are, or -1."""
    kept, lost, stubborn = 0, 0, 0
    for i in range(key.size):
        k, o = key[i], order[i]
        if lost + STUBBORN >= lost_key.size:
            return kept, -1
        back = 0
        if kept > 0:
            before = key[kept - 1]
            back = 1 if k < before or (k == before and o < order[kept - 1]) else 0
        if back == 1 and stubborn == STUBBORN and kept > 1:
            # So many that are less than the last: it is what is out of order.
            a, b = key[kept - 2], order[kept - 2]
            if a < k or (a == k and b < o):
                lost_key[lost], lost_order[lost] = key[kept - 1], order[kept - 1]
                lost, kept, back = lost + 1, kept - 1, 0
        if back == 1:
            lost_key[lost], lost_order[lost] = k, o
            lost, stubborn = lost + 1, min(stubborn + 1, STUBBORN)
        else:
            key[kept], order[kept] = k, o
            kept, stubborn = kept + 1, 0
    return kept, lost


@jit(numba=False)
def _merge(key: Any, order: Any, kept: Any, lost_key: Any, lost_order: Any) -> None:
    """Merge the first `kept` with the lost ones, from the last to the first."""
    i, j = kept - 1, lost_key.size - 1
    place = key.size - 1
    while j >= 0:
        takes = i >= 0
        if takes:
            a, b = key[i], lost_key[j]
            takes = a > b or (a == b and order[i] > lost_order[j])
        if takes:
            key[place], order[place] = key[i], order[i]
            i -= 1
        else:
            key[place], order[place] = lost_key[j], lost_order[j]
            j -= 1
        place -= 1
