"""Collisions of spheres, one pair after another, in rounds.

Space is cut into slabs across one axis, each wider than two reaches, so that nobody is near two
slabs that are not neighbours: of the pairs whose first sphere is in a slab, those of every other
slab can collide at the same time, and the order, and so the result, is the same for any number of
threads.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.piles import propagate
from motes.interact.search import Found
from motes.jit import EXACT, blocks, jit
from motes.repeat import Repeat

if TYPE_CHECKING:
    from motes.group.contacts import Planes

Array = NDArray[Any]

TOUCH = 1e-3
"""Distance, over its size, at which a sphere touches a solid."""

MOST = 32
"""Slabs at most, about: fewer are wider."""

ALONE = 4000
"""Spheres up to which threads cost more than they bring."""

ROWS = 1 << 12
"""Spheres of one task of what each does by itself."""


class Spheres(NamedTuple):
    """Spheres in the order of slabs."""

    x: Array
    """(3, n) positions [m]"""
    v: Array
    """(3, n) velocities [m/s]"""
    m: Array
    """(n,) masses [kg]"""
    size: Array
    """(n,) diameters [m]"""


class Law(NamedTuple):
    """How spheres collide: numbers of `HardSpheres`."""

    restitution: float
    friction: float
    slow: float
    rounds: int


def slabs(x: Array, reach: float, box: Array) -> tuple[Array, int]:
    """The slab (n,) of every position (3, n), and how many there are.

    They lie across the axis along which positions are spread most. `box`: periods, 0 along open
    axes [m]; positions may have left it since they were last wrapped.
    """
    axis = int(np.argmax(np.where(box > 0, box, x.std(axis=1) * 3.5)))
    width, period = 2 * reach * (1 + 1e-6), float(box[axis])
    if period:
        layers = max(np.floor(period / width), 1)
        layer = np.floor(x[axis] * (layers / period)) % layers
    else:
        layer = np.floor((x[axis] - x[axis].min()) / width)
    _, layer, counts = np.unique(layer, return_inverse=True, return_counts=True)
    enough = x.shape[1] / MOST  # Neighbouring layers make one slab until they hold so many.
    begins, held = np.zeros(counts.size, np.int64), 0.0
    for k, count in enumerate(counts.tolist()):
        if held >= enough:
            begins[k], held = 1, 0.0
        held += count
    number = np.cumsum(begins)
    if period and number[-1] % 2 == 0 and number[-1] > 0:
        number = np.minimum(number, number[-1] - 1)  # A ring needs an even number.
    return number[layer], int(number[-1]) + 1


def collide(
    spheres: Spheres, near: Found, begins: Array, period: Array, planes: Planes, law: Law
) -> bool:
    """Impulses between spheres that overlap and approach, and between them and solids.

    Those that approach slower than `slow` only stop. Positions are moved apart, heavier ones less,
    until none overlap or the rounds are over. `near`: who may overlap, each pair once; `begins`:
    the first sphere of each slab and, last, how many there are; `planes`: solids, with gaps as of
    now. Returns whether any collided.
    """
    x, v, m, size = spheres
    start, n = x.copy(), m.size
    ranges = list(zip(begins[:-1].tolist(), begins[1:].tolist(), strict=True))
    rows = blocks(n, ROWS) if planes.gap.shape[1] else []
    told = np.zeros((len(ranges) + len(rows), 2), np.int64)
    hit = near.first, near.row, x, v, m, size, period, *law[:3], told
    land = x, v, size, start, *planes, *law[:3], told
    if n <= ALONE:
        slab, ground = np.array(ranges), np.array(rows, np.int64).reshape(-1, 2)
        _rounds(*hit, start, *planes, slab, ground, law.rounds)
    else:
        tasks = [(k, *part) for k, part in enumerate(ranges)]
        even, odd = (Repeat(_hit, hit, tasks[k::2]) for k in (0, 1))
        last = [(len(ranges) + k, *part) for k, part in enumerate(rows)]
        grounds = Repeat(_land, land, last)
        for _ in range(law.rounds):
            told[:, 1] = 0
            even()
            odd()
            grounds()
            if not told[:, 1].any():
                break
    collided = bool(told[:, 0].any())
    if collided and rows:
        propagate(near, spheres, period, start, planes, law.friction)
    return collided


@jit(flags=EXACT)
def _rounds(
    first: Any, row: Any, x: Any, v: Any, m: Any, size: Any, period: Any, restitution: Any,
    friction: Any, slow: Any, told: Any, start: Any, gap: Any, normal: Any, held: Any, slab: Any,
    ground: Any, rounds: Any,
) -> None:  # fmt: skip
    """What `collide` does with threads, in one call."""
    slabs = slab.shape[0]
    for _ in range(rounds):
        told[:, 1] = 0
        for colour in range(2):
            for k in range(colour, slabs, 2):
                _hit(
                    first, row, x, v, m, size, period, restitution, friction, slow, told, k,
                    slab[k, 0], slab[k, 1],
                )  # fmt: skip
        for k in range(ground.shape[0]):
            _land(
                x, v, size, start, gap, normal, held, restitution, friction, slow, told, slabs + k,
                ground[k, 0], ground[k, 1],
            )  # fmt: skip
        loud = np.int64(0)
        for k in range(told.shape[0]):
            loud += told[k, 1]
        if loud == 0:
            return


@jit(flags=EXACT)
def _hit(
    first: Any, row: Any, x: Any, v: Any, m: Any, size: Any, period: Any, restitution: Any,
    friction: Any, slow: Any, told: Any, task: Any, begin: Any, end: Any,
) -> None:  # fmt: skip
    """One round of the pairs of some spheres; `told` gets collisions, and whether all is quiet."""
    count, loud = np.int64(0), np.int64(0)
    for i in range(begin, end):
        for e in range(first[i], first[i + 1]):
            j = row[e]
            dx, dy, dz = x[0, i] - x[0, j], x[1, i] - x[1, j], x[2, i] - x[2, j]
            dx -= period[0] * np.round(dx / period[0])
            dy -= period[1] * np.round(dy / period[1])
            dz -= period[2] * np.round(dz / period[2])
            reach = 0.5 * (size[i] + size[j])
            square = dx * dx + dy * dy + dz * dz
            if square >= reach * reach:
                continue
            far = np.sqrt(square)
            nx, ny, nz = 1.0, 0.0, 0.0  # Two at one place part along x.
            if far > 0:
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
                loud += un <= -1e-12
            count += 1
            apart = (reach - far) / (wi + wj)
            x[0, i] += wi * apart * nx
            x[1, i] += wi * apart * ny
            x[2, i] += wi * apart * nz
            x[0, j] -= wj * apart * nx
            x[1, j] -= wj * apart * ny
            x[2, j] -= wj * apart * nz
            loud += apart * (wi + wj) >= 1e-6 * reach
    told[task, 0] += count
    told[task, 1] = loud


@jit(flags=EXACT)
def _land(
    x: Any, v: Any, size: Any, start: Any, gap: Any, normal: Any, held: Any, restitution: Any,
    friction: Any, slow: Any, told: Any, task: Any, begin: Any, end: Any,
) -> None:  # fmt: skip
    """One round of some spheres with the solids that they touch."""
    count, loud = np.int64(0), np.int64(0)
    for i in range(begin, end):
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
                loud += un <= -1e-12
                count += 1
            if away < 0:
                x[0, i] -= away * nx
                x[1, i] -= away * ny
                x[2, i] -= away * nz
                loud += away <= -1e-6 * size[i]
                count += 1
    told[task, 0] += count
    told[task, 1] = loud
