"""LANES numbers that travel together, as the kernels of gravity read and write them."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import EXACT, jit
from motes.machine.lanes import choose, put, rough_inverse_root, spread_over, take
from motes.machine.traced import LANES

__all__ = ["LANES", "inverse_root", "maximum", "minimum", "read", "spread", "write"]

HALF, MORE = np.float32(0.5), np.float32(1.5)


@jit(inline=True)
def read(column: Any, first: Any) -> Any:
    """LANES numbers of a contiguous column from `first` on."""
    return take(column, first, LANES)


@jit(inline=True)
def write(column: Any, first: Any, lanes: Any) -> None:
    """Write lanes into a contiguous column from `first` on."""
    put(column, first, lanes)


@jit(inline=True, flags=EXACT)
def maximum(a: Any, b: Any) -> Any:
    """The larger of each two; b where a is not a number."""
    return choose(a > b, a, b)


@jit(inline=True, flags=EXACT)
def minimum(a: Any, b: Any) -> Any:
    """The smaller of each two; b where a is not a number."""
    return choose(a < b, a, b)


@jit(inline=True, flags=EXACT)
def inverse_root(x: Any) -> Any:
    """1 / root in double precision: Householder's third-order step from single's 22 bits."""
    near = np.float32(x)
    y = rough_inverse_root(near)
    y = y * (MORE - HALF * (near * (y * y)))
    better = np.float64(y)
    h = 1.0 - x * (better * better)
    return better + better * h * (0.5 + 0.375 * h)


@jit(inline=True)
def spread(value: Any) -> Any:
    """Lanes that all hold one number."""
    return spread_over(value, LANES)
