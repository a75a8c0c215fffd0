"""Lists of neighbours of particles: every slot within a radius of one.

They are sought cluster by cluster: what may be near any of its particles is gathered once into
consecutive memory, where every particle looks for its own. Lists are filled up with nobody to whole
vectors, so that sums over them are vector instructions without a rest.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.arrange import CLUSTER, FAR, Arranged
from motes.interact.cells import Grid
from motes.jit import STRICT, each, jit
from motes.machine.lanes import LANES, near_slots, taken_apart
from motes.memory import allocate


class Part(NamedTuple):
    """The lists of consecutive particles."""

    begin: int
    """Slot of the first particle."""
    first: NDArray[np.int64]
    """(k + 1,) where their lists begin in `entry` and, last, end, divided by `LANES`."""
    entry: NDArray[np.int32]
    """Slots of neighbours; the slot after the last stands for nobody."""
    longest: int
    """Length of the longest list."""


Room = list[NDArray[np.int32]]
"""Memory for entries of consecutive parts, to be used again for lists that replace those in it."""


class _Candidates(NamedTuple):
    """Candidates of one cluster."""

    position: NDArray[Any]
    slot: NDArray[np.int32]


def _candidates(points: int, real: Any) -> _Candidates:
    return _Candidates(np.zeros((3, points), real), np.empty(points, np.int32))


@jit(inline=True, flags=STRICT)
def _span(low: Any, high: Any, origin: Any, scale: Any, count: Any, wraps: Any) -> Any:
    """First cell and number of cells from a coordinate to another; they may go round the end."""
    first, last = np.floor((low - origin) * scale), np.floor((high - origin) * scale)
    if wraps:
        number = min(last - first + 1, np.float64(count))
        return np.int64(first - count * np.floor(first / count)), np.int64(number)
    first, last = max(first, np.float64(0)), min(last, np.float64(count - 1))
    return np.int64(first), np.int64(max(last - first + 1, np.float64(0)))


@jit(inline=True, flags=STRICT)
def _between(low: Any, high: Any, left: Any, wide: Any, wraps: Any, slack: Any) -> Any:
    """Square of the distance along an axis between a box and a cell, at most."""
    if wraps:
        return np.float64(0)
    apart = max(left - high, low - (left + wide)) - slack
    return max(apart, np.float64(0)) ** 2


@jit(inline=True)
def _from(number: Any, table: Any, keys: Any, shift: Any) -> Any:
    """The first point whose cell's number is not below a number."""
    entry = np.uint64(number) >> shift
    if entry >= np.uint64(table.size - 1):
        return np.int64(keys.size)
    low = np.int64(table[entry])
    if shift > np.uint64(0):
        high = np.int64(table[entry + np.uint64(1)])
        while low < high:
            middle = (low + high) >> 1
            if keys[np.uint64(middle)] < np.uint64(number):
                low = middle + 1
            else:
                high = middle
    return low


@jit(flags=STRICT)
def _collect(
    low: Any, high: Any, wide: Any, grid: Any, xs: Any, ys: Any, zs: Any, keys: Any, table: Any,
    shift: Any, begin: Any, points: Any, rx: Any, ry: Any, rz: Any, slot: Any,
) -> Any:  # fmt: skip
    """Append the points of all cells within `wide` of a box to the room, as far as it goes."""
    if keys.size == 0:
        return points
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    x0, y0, z0 = grid.low[0], grid.low[1], grid.low[2]
    sx, sy, sz = grid.scale[0], grid.scale[1], grid.scale[2]
    wraps_x, wraps_y, wraps_z = grid.wraps[0], grid.wraps[1], grid.wraps[2]
    slack, cy, cz = 1e-6 * wide, 1 / sy, 1 / sz
    y, ny_around = _span(low[1] - wide, high[1] + wide, y0, sy, ny, wraps_y)
    z, nz_around = _span(low[2] - wide, high[2] + wide, z0, sz, nz, wraps_z)
    for k in range(z, z + nz_around):
        dz2 = _between(low[2], high[2], z0 + k * cz, cz, wraps_z, slack)
        layer = (k - nz if k >= nz else k) * ny
        for j in range(y, y + ny_around):
            left2 = wide * wide - dz2 - _between(low[1], high[1], y0 + j * cy, cy, wraps_y, slack)
            if left2 < 0:
                continue
            half = np.sqrt(left2) + slack
            x, nx_around = _span(low[0] - half, high[0] + half, x0, sx, nx, wraps_x)
            row = (layer + (j - ny if j >= ny else j)) * nx
            start, left = x, nx_around
            while left > 0:
                length = min(left, nx - start)
                first = _from(row + start, table, keys, shift)
                last = _from(row + start + length, table, keys, shift)
                if points + last - first <= slot.size:
                    p = np.uint64(points)
                    for q in range(np.uint64(first), np.uint64(last)):
                        rx[p], ry[p], rz[p] = xs[q], ys[q], zs[q]
                        slot[p] = np.int32(begin) + np.int32(q)
                        p += np.uint64(1)
                points += last - first
                start, left = np.int64(0), left - length
    return points


@jit(flags=STRICT)
def _seek(
    position: Any,
    cells: Any,
    ghosts: Any,
    grid: Any,
    inner: Any,
    radius: Any,
    itself: Any,
    state: Any,
    part: Any,
    cluster: Any,
    room: Any,
    first: Any,
    entry: Any,
) -> None:
    """Append lists of a part's clusters; `state` holds the first without, and what that needs."""
    real = position.dtype.type
    limit = real(radius) * real(radius)
    wide = radius * (1 + 2.0**-18)
    n = cells.key.size
    nobody = np.int32(n + ghosts.key.size)
    far = real(FAR)
    xs, ys, zs = position[0], position[1], position[2]
    cx, cy, cz = cells.position[0], cells.position[1], cells.position[2]
    gx, gy, gz = ghosts.position[0], ghosts.position[1], ghosts.position[2]
    cell_key, cell_table, cell_shift = cells.key, cells.first, cells.shift
    ghost_key, ghost_table, ghost_shift = ghosts.key, ghosts.first, ghosts.shift
    rx, ry, rz = room.position[0], room.position[1], room.position[2]
    slots = room.slot
    for c in range(state[part, 0], cluster.size - 1):
        a, b = cluster[c], cluster[c + 1]
        low = (np.float64(xs[a]), np.float64(ys[a]), np.float64(zs[a]))
        high = low
        for i in range(a + 1, b):
            x, y, z = np.float64(xs[i]), np.float64(ys[i]), np.float64(zs[i])
            low = (min(low[0], x), min(low[1], y), min(low[2], z))
            high = (max(high[0], x), max(high[1], y), max(high[2], z))
        points = _collect(
            low, high, wide, grid, cx, cy, cz, cell_key, cell_table, cell_shift, np.int64(0),
            np.int64(0), rx, ry, rz, slots,
        )  # fmt: skip
        alone = True
        for axis in range(3):
            alone &= (low[axis] - wide > inner[0, axis]) & (high[axis] + wide < inner[1, axis])
        if not alone:
            points = _collect(
                low, high, wide, grid, gx, gy, gz, ghost_key, ghost_table, ghost_shift, n,
                points, rx, ry, rz, slots,
            )  # fmt: skip
        size = (points + LANES - 1) // LANES * LANES
        total = LANES * first[a - cluster[0]]
        if size > slots.size or total + (b - a) * (size + LANES) > entry.size:
            state[part, 0], state[part, 1] = c, size
            return
        for q in range(points, size):
            rx[q], slots[q] = far, nobody
        px, py, pz, slot = rx[:size], ry[:size], rz[:size], slots[:size]
        for i in range(a, b):
            x, y, z = xs[i], ys[i], zs[i]
            me = np.int32(i) if itself else np.int32(-1)
            found = near_slots(x, y, z, limit, me, px, py, pz, slot, entry[total:])
            full = (found + LANES - 1) // LANES * LANES
            for q in range(total + found, total + full):
                entry[q] = nobody
            total += full
            first[i - cluster[0] + 1] = total // LANES
    state[part, 0] = cluster.size - 1


def lists(
    targets: Arranged, sources: Arranged, cut: Grid, radius: float, room: Room | None = None
) -> list[Part]:
    """Every particle's neighbours among the sources within `radius` [m], without itself.

    Entries go into `room` where that is large enough.
    """
    position = targets.real.position
    real = position.dtype.type
    state = np.zeros((len(targets.clusters), 2), np.int64)
    head = (
        position, sources.real, sources.ghosts, cut, sources.inner, float(radius),
        targets is sources, state,
    )  # fmt: skip
    work = []
    for k, cluster in enumerate(targets.clusters):
        many = int(cluster[-1] - cluster[0])
        entry = room[k] if room and k < len(room) else np.empty(96 * many + 4096, np.int32)
        work.append((k, cluster, _candidates(1024, real), np.zeros(many + 1, np.int64), entry))
    waiting = work
    while waiting:
        each(_seek, head, waiting)
        waiting = [one for one in work if state[one[0], 0] < one[1].size - 1]
        for one in waiting:
            work[one[0]] = _wider(one, *state[one[0]].tolist(), real)
        waiting = [work[one[0]] for one in waiting]
    parts = []
    if room is not None:
        room[:] = [one[-1] for one in work]
    for _, cluster, _, first, entry in work:
        longest = LANES * int(np.diff(first).max(initial=1))
        parts.append(Part(int(cluster[0]), first, entry[: LANES * int(first[-1])], longest))
    return parts


def _wider(one: Any, begin: int, points: int, real: Any) -> Any:
    """A part's work with room to go on."""
    k, cluster, room, first, entry = one
    if points > room.slot.size:
        room = _candidates(2 * points, real)
    done, many = int(cluster[begin] - cluster[0]), int(cluster[-1] - cluster[0])
    held = LANES * int(first[done])
    needed = held + CLUSTER * (points + LANES)
    if needed > entry.size:
        likely = int(1.1 * needed * many / done) if done > many // 8 else 2 * needed
        larger = allocate((max(likely, needed),), np.int32, "a list of neighbours")
        larger[:held] = entry[:held]
        entry = larger
    return k, cluster, room, first, entry


@jit(flags=STRICT)
def _shorten(
    own: Any, others: Any, limit: Any, begin: Any, first: Any, entry: Any, longest: Any,
    new_first: Any, new_entry: Any,
) -> None:  # fmt: skip
    """Copy those entries of a part's lists that are within a square of a distance."""
    room = np.empty((3, longest), own.dtype)
    nobody, total = np.int32(others.shape[0] - 1), np.int64(0)
    for k in range(first.size - 1):
        slot = entry[LANES * first[k] : LANES * first[k + 1]]
        xs, ys, zs = room[0][: slot.size], room[1][: slot.size], room[2][: slot.size]
        taken_apart(others, slot, xs, ys, zs)
        x, y, z = own[begin + k, 0], own[begin + k, 1], own[begin + k, 2]
        out = new_entry[total:]
        found = near_slots(x, y, z, limit, np.int32(-1), xs, ys, zs, slot, out)
        full = (found + LANES - 1) // LANES * LANES
        for q in range(found, full):
            out[q] = nobody
        total += full
        new_first[k + 1] = total // LANES


def shortened(
    parts: Sequence[Part], own: NDArray[Any], others: NDArray[Any], radius: float, room: Room
) -> list[Part]:
    """What of lists is within a smaller radius [m] of places (slots + 1, 4) as they are now."""
    for k, part in enumerate(parts):
        needed = part.entry.size + LANES
        if k >= len(room):
            room.append(np.empty(needed, np.int32))
        elif room[k].size < needed:
            room[k] = np.empty(needed + needed // 16, np.int32)
    work = [(*part, np.zeros_like(part.first), room[k]) for k, part in enumerate(parts)]
    limit = own.dtype.type(radius) ** 2
    each(_shorten, (own, others, limit), work)
    return [Part(begin, first, entry, most) for begin, _, _, most, first, entry in work]
