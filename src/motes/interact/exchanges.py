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

TOUCH = 1e-3
"""Distance, over its size, at which a sphere touches a solid."""

STEEP = 0.3
"""Least cosine between the normal of a solid that bears a pile and the way against its weight."""

SWEEPS = 4
"""Rounds for each layer of a pile: a sphere lies on several others."""


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
    first: Any, row: Any, x: Any, v: Any, m: Any, size: Any, period: Any, start: Any, gap: Any,
    normal: Any, held: Any, restitution: Any, friction: Any, slow: Any, rounds: Any,
) -> Any:  # fmt: skip
    """Impulses between spheres that overlap and approach, one pair after another, in order.

    Those that approach slower than `slow` only stop. Positions are moved apart, heavier ones less,
    until none overlap or the rounds are over. Solids are planes, with gaps as of the positions
    `start`. Returns how often any did.
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
        for i in range(held.size):
            for k in range(held[i]):
                nx, ny, nz = normal[i, k, 0], normal[i, k, 1], normal[i, k, 2]
                away = gap[i, k] + (x[0, i] - start[0, i]) * nx
                away += (x[1, i] - start[1, i]) * ny + (x[2, i] - start[2, i]) * nz
                if away > TOUCH * size[i]:
                    continue
                un = v[0, i] * nx + v[1, i] * ny + v[2, i] * nz
                if un < 0:
                    push = -(1 + (restitution if un < -slow else 0.0)) * un
                    tx, ty, tz = v[0, i] - un * nx, v[1, i] - un * ny, v[2, i] - un * nz
                    ut = np.sqrt(tx * tx + ty * ty + tz * tz)
                    rub = min(friction * push, ut) / ut if ut > 0 else 0.0
                    v[0, i] += push * nx - rub * tx
                    v[1, i] += push * ny - rub * ty
                    v[2, i] += push * nz - rub * tz
                    quiet = quiet and un > -1e-12
                    count += 1
                if away < 0:
                    x[0, i] -= away * nx
                    x[1, i] -= away * ny
                    x[2, i] -= away * nz
                    quiet = quiet and away > -1e-6 * size[i]
                    count += 1
        if quiet:
            break
    if count and held.size:
        _propagate(first, row, x, v, size, period, start, gap, normal, held, friction)
    return count


@jit(inline=True, flags=EXACT)
def _away(x: Any, i: Any, k: Any, start: Any, gap: Any, normal: Any) -> Any:
    """Distance of a sphere that has been moved from one of its planes."""
    moved = gap[i, k] + (x[0, i] - start[0, i]) * normal[i, k, 0]
    moved += (x[1, i] - start[1, i]) * normal[i, k, 1]
    return moved + (x[2, i] - start[2, i]) * normal[i, k, 2]


@jit(inline=True, flags=EXACT)
def _stopped(v: Any, i: Any, n: Any, u: Any, friction: Any) -> None:
    """Stop a sphere's approach, with a velocity u along -n, to something that does not give way."""
    un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    if un < 0:
        tx, ty, tz = u[0] - un * n[0], u[1] - un * n[1], u[2] - un * n[2]
        ut = np.sqrt(tx * tx + ty * ty + tz * tz)
        rub = min(-friction * un, ut) / ut if ut > 0 else 0.0
        v[0, i] -= un * n[0] + rub * tx
        v[1, i] -= un * n[1] + rub * ty
        v[2, i] -= un * n[2] + rub * tz


@jit(flags=EXACT)
def _propagate(
    first: Any, row: Any, x: Any, v: Any, size: Any, period: Any, start: Any, gap: Any,
    normal: Any, held: Any, friction: Any,
) -> None:  # fmt: skip
    """Let what rounds have left of approaches end on what stands on solids, layer by layer.

    A sphere's layer is the number of contacts from a solid that bears it: one against which what
    touches moves on the whole. In a contact the lower one does not give way, since the ground bears
    it. So piles come to rest in whole, for which rounds alone would have to be many. Source:
    Guendelman, Bridson and Fedkiw, ACM Transactions on Graphics 22 (2003) 871, section 8.
    """
    n = held.size
    nowhere = np.int64(n + 1)
    layer, changed, last = np.empty(n, np.int64), True, np.int64(0)
    near = np.zeros(max(first[n], 1), np.uint8)
    px = py = pz = np.float64(0)
    for i in range(n):
        for e in range(first[i], first[i + 1]):
            far2 = np.float64(0)
            for axis in range(3):
                d = x[axis, i] - x[axis, row[e]]
                d -= period[axis] * np.round(d / period[axis])
                far2 += d * d
            reach = 0.5 * (1 + TOUCH) * (size[i] + size[row[e]])
            near[e] = np.uint8((far2 <= reach * reach) & (far2 > 0))
            if near[e] != 0:
                px, py, pz = px + v[0, i], py + v[1, i], pz + v[2, i]
    press = np.sqrt(px * px + py * py + pz * pz) + 1e-300
    down = (px / press, py / press, pz / press)
    for i in range(n):
        layer[i] = nowhere
        for k in range(held[i]):
            nx, ny, nz = normal[i, k, 0], normal[i, k, 1], normal[i, k, 2]
            if _away(x, i, k, start, gap, normal) <= TOUCH * size[i]:
                _stopped(v, i, (nx, ny, nz), (v[0, i], v[1, i], v[2, i]), friction)
                if nx * down[0] + ny * down[1] + nz * down[2] < -STEEP:
                    layer[i] = 0
    while changed:
        changed = False
        for i in range(n):
            for e in range(first[i], first[i + 1]):
                if near[e] != 0:
                    j = np.int64(row[e])
                    if layer[i] + 1 < layer[j]:
                        layer[j], changed, last = layer[i] + 1, True, max(last, layer[i] + 1)
                    elif layer[j] + 1 < layer[i]:
                        layer[i], changed, last = layer[j] + 1, True, max(last, layer[j] + 1)
    for turn in range(SWEEPS * last):
        above = 1 + turn // SWEEPS
        for i in range(n):
            if layer[i] == above:
                for k in range(held[i]):
                    if _away(x, i, k, start, gap, normal) <= TOUCH * size[i]:
                        direction = (normal[i, k, 0], normal[i, k, 1], normal[i, k, 2])
                        _stopped(v, i, direction, (v[0, i], v[1, i], v[2, i]), friction)
            for e in range(first[i], first[i + 1]):
                j = np.int64(row[e])
                if near[e] == 0 or layer[i] == layer[j] or max(layer[i], layer[j]) != above:
                    continue
                up, low = (i, j) if layer[i] > layer[j] else (j, i)
                dx, dy, dz = x[0, up] - x[0, low], x[1, up] - x[1, low], x[2, up] - x[2, low]
                dx -= period[0] * np.round(dx / period[0])
                dy -= period[1] * np.round(dy / period[1])
                dz -= period[2] * np.round(dz / period[2])
                far = np.sqrt(dx * dx + dy * dy + dz * dz)
                u = (v[0, up] - v[0, low], v[1, up] - v[1, low], v[2, up] - v[2, low])
                _stopped(v, up, (dx / far, dy / far, dz / far), u, friction)
