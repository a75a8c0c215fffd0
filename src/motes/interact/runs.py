"""Where the points near a box are: runs of consecutive points, in the order of cells.

Cells are narrow along x, so that a run of points in a row of cells begins and ends about where the
reach does. How wide rows of cells are is free, since a search looks into as many as it has to.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import Grid, first_from, grid
from motes.jit import STRICT, jit
from motes.machine.lanes import fetch, put_some, take

ALONG = 4
"""Cells along x for each reach."""

MOST_ACROSS = 4
"""Most rows of cells across a reach."""

ROW = 8.0
"""Points that a cube as wide as a row should hold, as one of them sees it."""

SAMPLE, SAMPLES = 1 << 11, 16
"""Points in a piece of the order, and pieces, that tell how dense they are."""


def rows_of_cells(
    bounds: NDArray[np.float64], reach: float, across: int, box: NDArray[Any], low: NDArray[Any]
) -> Grid:
    """Cells of a reach [m] by `ALONG` along x and `across` along y and z, for points in bounds."""
    cut = grid(bounds, (reach / ALONG, reach / across, reach / across), box)
    np.copyto(cut.low, low, where=np.isfinite(box))
    return cut


def rows_wanted(key: NDArray[np.uint64]) -> int:
    """Rows across a reach, for points whose cells with one row have these numbers, rising.

    Where points are dense, narrow rows miss what is out of reach.
    """
    some = key
    if key.size > SAMPLE:
        begins = np.linspace(0, key.size - SAMPLE, SAMPLES).astype(int).tolist()
        some = np.concatenate([key[begin : begin + SAMPLE] for begin in begins])
    seen = 1 + ALONG * (_together(some) / max(some.size, 1) - 1)
    wanted: float = (max(seen, 0.0) / ROW) ** (1 / 3)
    return min(max(round(wanted), 1), MOST_ACROSS)


@jit
def _together(key: Any) -> Any:
    """Sum of the squares of how many equal ones are next to one another."""
    total, run = np.int64(0), np.int64(0)
    for i in range(key.size):
        run = run + 1 if i > 0 and key[i] == key[i - 1] else np.int64(1)
        total += 2 * run - 1
    return total


@jit(flags=STRICT)
def inside(given: Any, low: Any, size: Any, position: Any, bounds: Any) -> None:
    """Write points (3, n) within a box that repeats where `size` is above 0, and their bounds.

    What is not a finite number becomes 0.
    """
    for axis in range(3):
        begin, period = low[axis], size[axis]
        least, most = size.dtype.type(np.inf), -size.dtype.type(np.inf)
        for i in range(position.shape[1]):
            x = position.dtype.type(given[axis, i])
            if not np.isfinite(x):
                x = position.dtype.type(0)
            away = x - begin
            if period > 0 and not (0 <= away < period):
                x -= period * np.floor(away / period)
                x = x if begin <= x < begin + period else begin
            position[axis, i] = x
            least, most = min(least, x), max(most, x)
        bounds[0, axis], bounds[1, axis] = least, most


@jit
def pick(values: Any, row: Any, out: Any) -> None:
    """Write the values of some rows."""
    for i in range(row.size):
        out[i] = values[row[i]]


@jit(inline=True, flags=STRICT)
def _span(low: Any, high: Any, origin: Any, scale: Any, count: Any, wraps: Any) -> Any:
    """First and last cell from a coordinate to another; beyond the ends where they go on."""
    first, last = np.floor((low - origin) * scale), np.floor((high - origin) * scale)
    if wraps:
        return np.int64(first), np.int64(min(last, first + np.float64(count - 1)))
    return np.int64(max(first, np.float64(0))), np.int64(min(last, np.float64(count - 1)))


@jit(inline=True, flags=STRICT)
def _gap(low: Any, high: Any, left: Any, wide: Any, slack: Any) -> Any:
    """Square of the distance along an axis between a box and a cell, at most."""
    apart = max(max(left - high, low - (left + wide)) - slack, np.float64(0))
    return apart * apart


@jit(flags=STRICT)
def runs_near(low: Any, high: Any, reach: Any, grid: Any, cells: Any, run: Any, shift: Any) -> Any:
    """Write first and last of runs that hold all points within reach of a box, and some more.

    Returns how many runs there are, and how many points they hold.

    `run` (k, 2); `shift` (k, 3) is from a run's points to their images near the box. Runs for
    which there is no room are only counted.
    """
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    x0, y0, z0 = grid.low[0], grid.low[1], grid.low[2]
    sx, sy, sz = grid.scale[0], grid.scale[1], grid.scale[2]
    turn_x = np.float64(grid.box[0]) if np.isfinite(grid.box[0]) else np.float64(0)
    turn_y = np.float64(grid.box[1]) if np.isfinite(grid.box[1]) else np.float64(0)
    turn_z = np.float64(grid.box[2]) if np.isfinite(grid.box[2]) else np.float64(0)
    low = np.float64(low[0]), np.float64(low[1]), np.float64(low[2])
    high = np.float64(high[0]), np.float64(high[1]), np.float64(high[2])
    wide = np.float64(reach) * (1 + 2.0**-18)
    slack, cy, cz = 1e-6 * wide, 1 / sy, 1 / sz
    size, number, points = run.shape[0], np.int64(0), np.int64(0)
    y, last_y = _span(low[1] - wide, high[1] + wide, y0, sy, ny, grid.wraps[1])
    x, last_x = _span(low[0] - wide, high[0] + wide, x0, sx, nx, grid.wraps[0])
    z, last_z = _span(low[2] - wide, high[2] + wide, z0, sz, nz, grid.wraps[2])
    for k in range(z, last_z + 1):
        gap_z = _gap(low[2], high[2], z0 + np.float64(k) * cz, cz, slack)
        around_z = np.int64(0) if 0 <= k < nz else k // nz
        layer = (k - around_z * nz) * ny
        for j in range(y, last_y + 1):
            left = y0 + np.float64(j) * cy
            if gap_z + _gap(low[1], high[1], left, cy, slack) > wide * wide:
                continue
            around_y = np.int64(0) if 0 <= j < ny else j // ny
            row = (layer + j - around_y * ny) * nx
            i = x
            while i <= last_x:
                around_x = np.int64(0) if 0 <= i < nx else i // nx
                end = min(last_x, (around_x + 1) * nx - 1)
                begin = row + i - around_x * nx
                a = first_from(np.uint64(begin), cells)
                b = first_from(np.uint64(begin + end - i + 1), cells)
                ahead = np.uint64(begin + end - i + AHEAD)
                fetch(cells.first, ahead >> cells.shift)
                if a < b:
                    if number < size:
                        run[number, 0], run[number, 1] = a, b
                        shift[number, 0] = np.float64(around_x) * turn_x
                        shift[number, 1] = np.float64(around_y) * turn_y
                        shift[number, 2] = np.float64(around_z) * turn_z
                    number += 1
                    points += b - a
                i = end + 1
    return number, points


AHEAD = 16
"""Cells beyond a run whose entry of the table is fetched for those who look up the next ones."""

SHORT = 4
"""Whole vectors of a run that are written down without asking whether it is as long."""


@cache
def chooser(lanes: int) -> Any:
    """A kernel that chooses points, looking at a number of them at once.

    `choose(places, spots, limit, r, number, run, shift, block, ramp, pick)` writes into `pick` what
    is within reach of any of `spots` (3, lanes), `limit` its square, in run r and those after it
    that are shifted alike. It returns the run after them, and how many points there are. `block` is
    room, `ramp` is 0, 1, 2, ...

    Runs are written down as whole vectors first: a loop over few, whose number changes from run to
    run, costs more for the guesses that the processor gets wrong than for what it does.
    """

    @jit(inline=True)
    def choose(
        places: Any, spots: Any, limit: Any, r: Any, number: Any, run: Any, shift: Any, block: Any,
        ramp: Any, pick: Any,
    ) -> Any:  # fmt: skip
        dx, dy, dz = shift[r, 0], shift[r, 1], shift[r, 2]
        blocks = np.int64(0)
        while r < number and shift[r, 0] == dx and shift[r, 1] == dy and shift[r, 2] == dz:
            at, last = run[r, 0], run[r, 1]
            many = (last - at + (lanes - 1)) // lanes
            for e in range(SHORT):
                block[blocks + e, 0], block[blocks + e, 1] = at + e * lanes, last
            for e in range(SHORT, many):
                block[blocks + e, 0], block[blocks + e, 1] = at + e * lanes, last
            blocks += many
            r += 1
        held = 0
        for k in range(blocks):
            at, last = block[k, 0], block[k, 1]
            x, y = take(places[0], at, lanes), take(places[1], at, lanes)
            z, who = take(places[2], at, lanes), take(ramp, at, lanes)
            least = limit + limit
            for e in range(lanes):
                gx, gy = x - (spots[0, e] - dx), y - (spots[1, e] - dy)
                gz = z - (spots[2, e] - dz)
                least = min(least, gx * gx + gy * gy + gz * gz)
            near = (least <= limit) & (who < np.int32(last))
            held += put_some(pick, held, who, near)
        return r, held

    return choose
