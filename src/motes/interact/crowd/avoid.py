"""New velocities for a whole crowd: neighbours from cells, half-planes, one program an agent."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import MOST_RUNS, columns, grid, runs_around, sort
from motes.interact.crowd.density import walking, weight
from motes.interact.crowd.half_plane import contact, reciprocal
from motes.interact.crowd.program import velocity as allowed
from motes.interact.search import collect
from motes.jit import STRICT, blocks, jit, share

AGENTS = 1 << 11
"""Agents of one task."""

Array = NDArray[Any]


class Rules(NamedTuple):
    """How a crowd walks."""

    reach: float
    """Distance up to which others are minded [m]."""
    margin: float
    """Gap between two that they keep if they can [m]."""
    horizon: float
    """Time for which a velocity must be safe [s]."""
    step: float
    """Length of the step [s], in which those that overlap part."""
    top_speed: float
    """[m/s]"""
    crowded: bool
    """Whether density slows."""


class Walls(NamedTuple):
    """Half-planes of walls: those of agent i are plane[i, :held[i]]."""

    plane: Array
    """(n, most, 3)"""
    held: NDArray[np.int64]
    """(n,)"""


class _Room(NamedTuple):
    """Memory of one task."""

    runs: NDArray[np.int64]
    position: Array
    row: NDArray[np.int32]
    square: Array
    nearest: NDArray[np.int64]
    planes: NDArray[np.float64]
    other: NDArray[np.float64]


def _room(points: int, most: int, walls: int, real: Any) -> _Room:
    return _Room(
        np.empty((MOST_RUNS, 2), np.int64),
        np.empty((3, points), real),
        np.empty(points, np.int32),
        np.empty(points, real),
        np.empty(most + 1, np.int64),
        np.empty((walls + 2 * most, 3)),
        np.empty((walls + 2 * most, 3)),
    )


@jit(inline=True, flags=STRICT)
def _choose(points: Any, itself: Any, limit: Any, room: Any) -> Any:
    """Write which points are the nearest, nearest first, then as in cells; their number."""
    square, row, nearest = room.square, room.row, room.nearest
    most, held = nearest.size - 1, 0
    for q in range(points):
        value = square[q]
        if value > limit or row[q] == itself or most == 0:
            continue
        k = held
        while k > 0:
            other = nearest[k - 1]
            if square[other] < value or (square[other] == value and row[other] < row[q]):
                break
            nearest[k] = other
            k -= 1
        nearest[k] = q
        held = min(held + 1, most)
        if held == most:
            limit = square[nearest[most - 1]]
    return held


@jit(inline=True, flags=STRICT)
def _density(points: Any, reach2: Any, x: Any, y: Any, gx: Any, gy: Any, room: Any) -> Any:
    """People per area around a place [1/m2], those ahead (along g) counted up to twice."""
    length = np.sqrt(gx * gx + gy * gy)
    gx, gy = (gx / length, gy / length) if length > 0.0 else (0.0, 0.0)
    total = 0.0
    for q in range(points):
        square = np.float64(room.square[q])
        ahead = (room.position[0, q] - x) * gx + (room.position[1, q] - y) * gy
        far = np.sqrt(max(square, 1e-12))
        total += weight(square, reach2) * (1.0 + ahead / far)
    return total


@jit(inline=True, flags=STRICT)
def _note(planes: Any, k: Any, nx: Any, ny: Any, c: Any) -> None:
    planes[k, 0], planes[k, 1], planes[k, 2] = nx, ny, c


@jit(flags=STRICT)
def _avoid(
    cells: Any, grid: Any, order: Any, velocity: Any, radius: Any, wanted: Any, walls: Any,
    rules: Any, begin: Any, end: Any, room: Any, out: Any,
) -> Any:  # fmt: skip
    """Serve agents from `begin` on; returns one without room, and the points it needs.

    Cells, `velocity` and `radius` are in the order of cells, which `order` tells, the rest is not.
    """
    points = np.int64(0)
    reach2 = rules.reach * rules.reach
    for t in range(begin, end):
        if t == begin or cells.key[t] != cells.key[t - 1]:
            number, points, _ = runs_around(cells.key[t], grid, cells, room.runs)
            if points > room.row.size:
                return t, points
            collect(cells, number, room)
        x, y, i = cells.position[0, t], cells.position[1, t], order[t]
        others = room.position
        square = room.square[:points]
        for q in range(square.size):
            dx, dy = others[0, q] - x, others[1, q] - y
            square[q] = dx * dx + dy * dy
        gx, gy = np.float64(wanted[0, i]), np.float64(wanted[1, i])
        top = rules.top_speed
        if rules.crowded:
            top *= walking(_density(points, reach2, x, y, gx, gy, room))
        hard = walls.held[i]
        for k in range(hard):
            _note(room.planes, k, walls.plane[i, k, 0], walls.plane[i, k, 1], walls.plane[i, k, 2])
        vx, vy, mine = np.float64(velocity[0, t]), np.float64(velocity[1, t]), np.float64(radius[t])
        chosen = _choose(points, t, reach2, room)
        for k in range(chosen):
            q = room.nearest[k]
            px, py = np.float64(others[0, q]) - x, np.float64(others[1, q]) - y
            nx, ny, c = contact(px, py, mine + radius[room.row[q]], rules.step)
            if c > -top:
                _note(room.planes, hard, nx, ny, c)
                hard += 1
        held = hard
        for k in range(chosen):
            q = room.nearest[k]
            j = room.row[q]
            px, py = np.float64(others[0, q]) - x, np.float64(others[1, q]) - y
            ux, uy = vx - velocity[0, j], vy - velocity[1, j]
            both = mine + radius[j] + rules.margin
            plane = reciprocal(px, py, ux, uy, vx, vy, both, rules.horizon, rules.step)
            if plane[2] > -top:  # Else all velocities up to the top speed keep to it.
                _note(room.planes, held, plane[0], plane[1], plane[2])
                held += 1
        out[0, i], out[1, i] = allowed(room.planes, hard, held, top, gx, gy, room.other)
    return end, np.int64(0)


def avoid(
    position: Array, velocity: Array, wanted: Array, radius: Array,
    walls: Walls, rules: Rules, nearest: int,
) -> Array:  # fmt: skip
    """Velocities (2, n) [m/s] for agents at `position` (2, n) [m] that would go with `wanted`.

    `velocity` (2, n) is what they have, `radius` (n,) [m] how wide they are; of those within reach
    the `nearest` are minded.
    """
    real = position.dtype.type
    points, bounds = columns(position.T, np.full(3, np.inf, real), "position")
    cut = grid(bounds, rules.reach, np.full(3, np.inf, real))
    cells = sort(points, cut)
    order = cells.row
    cells = cells._replace(row=np.arange(order.size, dtype=np.int32))
    near_velocity, near_radius = velocity[:, order], radius[order]
    out = np.empty((2, position.shape[1]), real)
    parts = blocks(position.shape[1], AGENTS)

    def serve(part: int) -> None:
        begin, end = parts[part]
        points = 512
        while begin < end:
            room = _room(2 * points, nearest, walls.plane.shape[1], real)
            begin, points = _avoid(
                cells, cut, order, near_velocity, near_radius, wanted, walls, rules, begin, end,
                room, out,
            )  # fmt: skip

    share(serve, len(parts))
    return out
