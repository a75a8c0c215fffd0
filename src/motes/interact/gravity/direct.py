"""Direct sums over all pairs: exact, O(n^2), at the speed of the processor's vector units.

Each pair is computed twice, once for each side. Newton's third law would halve the arithmetic, but
its second half must add to as many places as there are sources, and those stores cost more.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.pairs import attraction
from motes.jit import blocks, jit, share

SOURCES = 1024
"""Sources that are summed in the precision of the pairs before they are added in double."""

_PAIRS_OF_A_TASK = 1 << 27


@cache
def _summation(law: str, real: type, potential: bool) -> Callable[..., Any]:
    """Compiled sum for a block of targets over all sources (4, n): writes `out` (4, targets)."""
    attract = attraction(law, real, potential)

    @jit(numba=False)
    def sum_block(target: Any, count: Any, source: Any, size: Any, part: Any, out: Any) -> None:
        out[:] = 0
        for low in range(0, source.shape[1], SOURCES):
            high = min(low + SOURCES, source.shape[1])
            part[:] = 0
            x, y = source[0, low:high], source[1, low:high]
            z, m = source[2, low:high], source[3, low:high]
            attract(target, count, (x, y, z, m), high - low, (0, 0, 0), size, part)
            for i in range(count):
                out[0, i] += part[0, i]
                out[1, i] += part[1, i]
                out[2, i] += part[2, i]
                out[3, i] += part[4, i]

    return sum_block  # type: ignore[no-any-return]


def direct(
    source: NDArray[Any], target: NDArray[Any], law: str, size: float, potential: bool
) -> NDArray[np.float64]:
    """Sums over all sources (4, n), rows x, y, z, m, at targets (3, k).

    Returns (4, k): three rows of sum m s dx, and with `potential` the sum of m w. Works in the
    precision of the arrays; equal coordinates have no force.
    """
    real: Any = source.dtype.type
    n, count = source.shape[1], target.shape[1]
    padded = np.zeros((4, -(-n // LANES) * LANES), real)
    padded[:, :n] = source
    rows = max(16, min(1024, _PAIRS_OF_A_TASK // max(n, 1)))
    ranges = blocks(count, rows)
    out = np.empty((4, count))
    sum_block = _summation(law, real, potential)

    def task(number: int) -> None:
        low, high = ranges[number]
        block, width = np.ascontiguousarray(target[:, low:high]), high - low
        part, result = np.empty((5, width), real), np.empty((4, width))
        sum_block(block, width, padded, real(size), part, result)
        out[:, low:high] = result

    share(task, len(ranges))
    return out
