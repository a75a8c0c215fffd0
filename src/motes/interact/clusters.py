"""Lists of neighbours: of clusters, whoever may be near any of their particles, and of particles.

Lists of clusters are short, and sought in cells; from them every particle takes its own, often,
since these hold hardly more than what is within reach. Lists are filled up with nobody to whole
vectors, so that loops over them are vector instructions without a rest. After Páll and Hess,
Computer Physics Communications 184 (2013) 2641.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from operator import le
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.arrange import CLUSTER, FAR, Arranged
from motes.interact.cells import Grid
from motes.jit import STRICT, Calls, each, jit
from motes.machine.shuffles import LANES, near_slots, taken_apart
from motes.memory import afford, allocate
from motes.repeat import Repeat

RADIUS, WANTED = range(2)
"""Places in the bounds of lists of particles: their radius [m], and whether they are wanted."""

LONGER = 2 * LANES
"""Entries by which the longest list may grow, until who reads lists needs more room."""

CANDIDATES = 1024
"""Candidates of a cluster that there is room for at first."""

NEAR_CLUSTER, NEAR_PARTICLE, SPARE = 512, 96, 4096
"""Entries that new lists have room for: of a cluster, of a particle, and of a part besides.

They are those of a liquid and some more; room that is not written to is no memory yet.
"""


class Part(NamedTuple):
    """The lists of consecutive particles."""

    begin: int
    """Slot of the first particle."""
    first: NDArray[np.int64]
    """(k + 1,) where their lists begin in `entry` and, last, end, divided by `LANES`."""
    entry: NDArray[np.int32]
    """Slots of neighbours; the slot after the last stands for nobody."""
    longest: int
    """What the longest list is not longer than."""


class Clusters(NamedTuple):
    """The lists of consecutive clusters."""

    cluster: NDArray[np.int32]
    """(k + 1,) slots at which the clusters begin and, last, end."""
    first: NDArray[np.int64]
    entry: NDArray[np.int32]
    longest: int


@dataclass
class Room:
    """Memory of the lists of consecutive parts, to be used again for lists that replace them."""

    entries: list[NDArray[np.int32]] = field(default_factory=list)
    work: list[Any] = field(default_factory=list)
    """What a kernel is called with for each part."""
    state: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), np.int64))
    """How far the kernel came in each part."""
    repeat: Repeat | None = None
    """The calls of the kernel, while they may be so again."""
    chosen: Calls | None = None
    """Lists of particles as calls of who reads them."""
    lists: Sequence[Clusters] | None = None
    """The lists of clusters that they were chosen from."""


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


@jit(inline=True, flags=STRICT)
def _to_box(low: Any, high: Any, x: Any) -> None:
    """Replace coordinates by what lies between them and an interval."""
    zero = x.dtype.type(0)
    for q in range(x.size):
        x[q] = max(max(low - x[q], x[q] - high), zero)


@jit(flags=STRICT)
def _seek(
    position: Any, cells: Any, ghosts: Any, grid: Any, inner: Any, state: Any, radius: Any,
    part: Any, cluster: Any, slots: Any, place: Any, first: Any, entry: Any,
) -> None:  # fmt: skip
    """Append lists of a part's clusters; `state` holds the first without, what that needs, and the
    length of the longest list so far."""
    real = position.dtype.type
    wide = radius[0] * (1 + 2.0**-18)
    limit, nought = real(wide) * real(wide), real(0)
    n = cells.key.size
    nobody, no_one = np.int32(n + ghosts.key.size), np.int32(-1)
    far = real(FAR)
    xs, ys, zs = position[0], position[1], position[2]
    cx, cy, cz = cells.position[0], cells.position[1], cells.position[2]
    gx, gy, gz = ghosts.position[0], ghosts.position[1], ghosts.position[2]
    cell_key, cell_table, cell_shift = cells.key, cells.first, cells.shift
    ghost_key, ghost_table, ghost_shift = ghosts.key, ghosts.first, ghosts.shift
    rx, ry, rz = place[0], place[1], place[2]
    longest = state[part, 2]
    for c in range(state[part, 0], cluster.size - 1):
        a, b = cluster[c], cluster[c + 1]
        x0 = x1 = xs[a]
        y0 = y1 = ys[a]
        z0 = z1 = zs[a]
        for i in range(a + 1, b):
            x0, x1 = min(x0, xs[i]), max(x1, xs[i])
            y0, y1 = min(y0, ys[i]), max(y1, ys[i])
            z0, z1 = min(z0, zs[i]), max(z1, zs[i])
        low = (np.float64(x0), np.float64(y0), np.float64(z0))
        high = (np.float64(x1), np.float64(y1), np.float64(z1))
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
        total = LANES * first[c]
        if size > slots.size or total + size + LANES > entry.size:
            state[part, 0], state[part, 1], state[part, 2] = c, size, longest
            return
        for q in range(points, size):
            rx[q], slots[q] = far, nobody
        px, py, pz = rx[:size], ry[:size], rz[:size]
        _to_box(x0, x1, px)
        _to_box(y0, y1, py)
        _to_box(z0, z1, pz)
        out = entry[total:]
        found = near_slots(nought, nought, nought, limit, no_one, px, py, pz, slots[:size], out)
        full = (found + LANES - 1) // LANES * LANES
        for q in range(found, full):
            out[q] = nobody
        first[c + 1] = (total + full) // LANES
        longest = max(longest, full)
    state[part, 0], state[part, 2] = cluster.size - 1, longest


@jit(flags=STRICT)
def _choose(
    own: Any, others: Any, itself: Any, state: Any, bounds: Any, part: Any, cluster: Any,
    near_first: Any, near: Any, place: Any, first: Any, entry: Any,
) -> None:  # fmt: skip
    """Append lists of the particles of a part's clusters, of what is within a radius, if wanted;
    `state` as for `_seek`."""
    if not bounds[WANTED] > 0:
        return
    radius = own.dtype.type(bounds[RADIUS])
    limit = radius * radius
    nobody, longest = np.int32(others.shape[0] - 1), state[part, 2]
    for c in range(state[part, 0], cluster.size - 1):
        a, b = cluster[c], cluster[c + 1]
        slot = near[LANES * near_first[c] : LANES * near_first[c + 1]]
        total = LANES * first[a - cluster[0]]
        if total + (b - a) * (slot.size + LANES) > entry.size:
            state[part, 0], state[part, 1], state[part, 2] = c, slot.size, longest
            return
        xs, ys, zs = place[0][: slot.size], place[1][: slot.size], place[2][: slot.size]
        taken_apart(others, slot, xs, ys, zs)
        for i in range(a, b):
            me = np.int32(i) if itself else np.int32(-1)
            out = entry[total:]
            x, y, z = own[i, 0], own[i, 1], own[i, 2]
            found = near_slots(x, y, z, limit, me, xs, ys, zs, slot, out)
            full = (found + LANES - 1) // LANES * LANES
            for q in range(found, full):
                out[q] = nobody
            total += full
            first[i - cluster[0] + 1] = total // LANES
            longest = max(longest, full)
    state[part, 0], state[part, 2] = cluster.size - 1, longest


def cluster_lists(
    targets: Arranged, sources: Arranged, cut: Grid, radius: float, room: Room
) -> list[Clusters]:
    """Slots of the sources within `radius` [m] of any of a cluster's particles, and some others.

    Entries go into `room` where that is large enough.
    """
    real = targets.real.position.dtype.type
    head = targets.real.position, sources.real, sources.ghosts, cut, sources.inner
    room.work, room.repeat = [], None
    entries = _entries(room, [NEAR_CLUSTER * cluster.size for cluster in targets.clusters])
    for k, (cluster, entry) in enumerate(zip(targets.clusters, entries, strict=True)):
        first = np.zeros(cluster.size, np.int64)
        slots, place = np.empty(CANDIDATES, np.int32), np.empty((3, CANDIDATES), real)
        room.work.append((k, cluster, slots, place, first, entry))
    longest, _ = _carried_out(_seek, head, np.array([float(radius)]), room)
    found = [Clusters(one[1], one[-2], one[-1], longest[one[0]]) for one in room.work]
    room.work, room.repeat = [], None
    return found


def particle_lists(
    lists: Sequence[Clusters], own: NDArray[Any], others: NDArray[Any],
    bounds: NDArray[np.float64], itself: bool, room: Room,
) -> Calls:  # fmt: skip
    """Each particle's neighbours within a radius [m] of places (slots + 1, 4), without itself.

    `bounds` holds the radius and that it is wanted, `itself` says that particles are among the
    others; entries go into `room` as before. Returns the lists, `Part`s, as last arguments of
    calls: those of before where they are in the same memory.
    """
    real = own.dtype.type
    if room.lists is not lists:
        room.lists, room.work, room.repeat, room.chosen = lists, [], None, None
        counts = [int(cluster[-1] - cluster[0]) for cluster, *_ in lists]
        entries = _entries(room, [NEAR_PARTICLE * many for many in counts])
        for k, (cluster, near_first, near, longest) in enumerate(lists):
            first, entry = np.zeros(counts[k] + 1, np.int64), entries[k]
            place = np.empty((3, longest), real)
            room.work.append((k, cluster, near_first, near, place, first, entry))
    most, grown = _carried_out(_choose, (own, others, itself), bounds, room)
    if room.chosen is not None and not grown:
        known = [int(part[-1]) for part in room.chosen.tails]
        if all(map(le, most, known)):
            return room.chosen
        most = list(map(max, most, known))
    most = [length + LONGER for length in most]
    parts = [Part(int(one[1][0]), one[5], one[6], most[one[0]]) for one in room.work]
    room.chosen = Calls(parts, alike=True)
    return room.chosen


def _entries(room: Room, likely: Sequence[int]) -> list[NDArray[np.int32]]:
    """Memory for the entries of all parts: that of before, if there is any.

    New memory is one array for all of them: the system gives large arrays in large pages.
    """
    if len(room.entries) != len(likely):
        ends = [0, *accumulate(size + SPARE for size in likely)]
        whole = allocate((ends[-1],), np.int32, "a list of neighbours")
        room.entries = [whole[begin:end] for begin, end in pairwise(ends)]
    return room.entries


def _carried_out(kernel: Any, head: Any, bounds: Any, room: Room) -> tuple[list[int], bool]:
    """Let a kernel fill the lists of all parts, with more room for those that need it.

    Returns the length of the longest list of every part, at least one vector, and whether any
    needed more room.
    """
    work = room.work
    if len(room.state) != len(work):
        room.state = np.empty((len(work), 3), np.int64)
    state = room.state
    state.fill(0)
    head = *head, state, bounds
    if room.repeat is None or not room.repeat.fits(kernel, head, room.repeat.tails):
        room.repeat = Repeat(kernel, head, Calls(list(work), alike=True))
    room.repeat()
    grown = False
    while waiting := [one for one in work if state[one[0], 0] < one[1].size - 1]:
        grown, room.repeat = True, None
        for one in waiting:
            work[one[0]] = _wider(one, *state[one[0], :2].tolist())
            afford(sum(part[-1].nbytes for part in work), "a list of neighbours")
        each(kernel, head, [work[one[0]] for one in waiting])
    room.entries = [one[-1] for one in work]
    return [max(LANES, longest) for longest in state[:, 2].tolist()], grown


def _wider(one: Any, begin: int, points: int) -> Any:
    """A part's work with room to go on from a cluster that has so many candidates."""
    cluster = one[1]
    place, first, entry = one[-3:]
    if points > place.shape[1]:  # Candidates, which also have slots.
        place = np.empty((3, 2 * points), place.dtype)
        one = *one[:2], np.empty(2 * points, np.int32), *one[3:]
    held, most = LANES * int(first.max()), CLUSTER * (points + LANES)
    if held + most > entry.size:
        likely = int(1.1 * held * cluster.size / max(begin, 1)) if 8 * begin > cluster.size else 0
        size = max(likely, 2 * held) + most
        larger = allocate((size,), np.int32, "a list of neighbours")
        larger[:held] = entry[:held]
        entry = larger
    return (*one[:-3], place, first, entry)
