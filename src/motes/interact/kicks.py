"""Random kicks that particles get at the end of a step."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import EXACT, blocks, jit, share
from motes.philox import draw, normal_double

if TYPE_CHECKING:
    from motes.group import Movers

ROWS = 1 << 14


def shaken(
    one: Movers, keep: float, spread: NDArray[np.float64], seed: int, channel: int, step: int
) -> None:
    """v becomes keep v + spread xi, with noise that hangs on the particle and the step."""
    parts = blocks(one.mass.size, ROWS)
    name, tick = np.uint32(channel), np.uint32(step & 0xFFFFFFFF)

    def shake(k: int) -> None:
        _shake(one.velocity, one.ids, keep, spread, np.uint64(seed), name, tick, *parts[k])

    share(shake, len(parts))


@jit(flags=EXACT)
def _shake(
    v: Any, ids: Any, keep: Any, spread: Any, seed: Any, channel: Any, tick: Any, lo: Any, hi: Any
) -> None:
    for i in range(lo, hi):
        a, b = normal_double(*draw(seed, ids[i], channel, tick))
        c, _ = normal_double(*draw(seed, ids[i], channel ^ np.uint32(0x80000000), tick))
        v[0, i] = keep * v[0, i] + spread[i] * a
        v[1, i] = keep * v[1, i] + spread[i] * b
        v[2, i] = keep * v[2, i] + spread[i] * c
