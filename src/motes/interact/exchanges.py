"""Loops of what particles exchange at the end of a step: random kicks and collisions."""

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


@jit(flags=EXACT)
def collide(
    first: Any, row: Any, x: Any, v: Any, m: Any, size: Any, period: Any, restitution: Any,
    friction: Any, slow: Any, rounds: Any,
) -> Any:  # fmt: skip
    """Impulses between spheres that overlap and approach, one pair after another, in order.

    Those that approach slower than `slow` only stop. Positions are moved apart, heavier ones less,
    until none overlap or the rounds are over. Returns how often any did.
    """
    count = 0
    for _ in range(rounds):
        quiet = True
        for i in range(first.size - 1):
            for e in range(first[i], first[i + 1]):
                j = row[e]
                dx, dy, dz = x[0, i] - x[0, j], x[1, i] - x[1, j], x[2, i] - x[2, j]
                dx -= period[0] * np.round(dx / period[0])
                dy -= period[1] * np.round(dy / period[1])
                dz -= period[2] * np.round(dz / period[2])
                reach = 0.5 * (size[i] + size[j])
                square = dx * dx + dy * dy + dz * dz
                if square >= reach * reach or square == 0:
                    continue
                far = np.sqrt(square)
                nx, ny, nz = dx / far, dy / far, dz / far
                wi, wj = 1 / m[i], 1 / m[j]
                ux, uy, uz = v[0, i] - v[0, j], v[1, i] - v[1, j], v[2, i] - v[2, j]
                un = ux * nx + uy * ny + uz * nz
                if un < 0:
                    bounce = restitution if un < -slow else 0.0
                    push = -(1 + bounce) * un / (wi + wj)
                    tx, ty, tz = ux - un * nx, uy - un * ny, uz - un * nz
                    ut = np.sqrt(tx * tx + ty * ty + tz * tz)
                    rub = min(friction * push, ut / (wi + wj)) / ut if ut > 0 else 0.0
                    jx, jy, jz = push * nx - rub * tx, push * ny - rub * ty, push * nz - rub * tz
                    v[0, i] += wi * jx
                    v[1, i] += wi * jy
                    v[2, i] += wi * jz
                    v[0, j] -= wj * jx
                    v[1, j] -= wj * jy
                    v[2, j] -= wj * jz
                    quiet = quiet and un > -1e-12
                count += 1
                apart = (reach - far) / (wi + wj)
                x[0, i] += wi * apart * nx
                x[1, i] += wi * apart * ny
                x[2, i] += wi * apart * nz
                x[0, j] -= wj * apart * nx
                x[1, j] -= wj * apart * ny
                x[2, j] -= wj * apart * nz
                quiet = quiet and apart * (wi + wj) < 1e-6 * reach
        if quiet:
            break
    return count
