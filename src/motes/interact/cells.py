"""Points sorted into cells, so that those near one another are near one another in memory.

Space is cut into boxes a little wider than the search radius: whatever lies within the radius of a
point is in its cell or in one next to it. Points are ordered by (cell, row), cells along x next to
one another, so that the cells around a point are a few runs of consecutive points. Only cells that
hold points cost memory: a run is looked up by the upper bits of its cell's number in a table of
about as many entries as there are points, and from there by halving. Where there are few more
cells than points the table has an entry per cell, and nothing is left to halve.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.counting_sort import Room, counted_rows, room_for, sorted_rows
from motes.jit import STRICT, blocks, jit, share

ROWS = 1 << 15
"""Points of one task."""

MOST_RUNS = 18
"""Runs of cells around a cell: nine rows, each in two parts where it crosses a periodic border."""

_ALONG = 1 << 20
"""Most cells along an axis: the numbers of three fit into 60 bits."""

_ROUNDING = {c: 4 * float(np.finfo(c).eps) for c in "efdg"}
"""What rounding can move a distance by, over the box, by type of numbers."""

_FARTHEST = float(np.finfo(np.float64).max) / 2
"""Cells, counted from 0, up to which a coordinate has a cell."""

_ENTRIES = 4
"""Most entries of the table per point."""


class Grid(NamedTuple):
    """How space is cut into cells."""

    low: NDArray[np.float64]
    """(3,) where cell 0 begins [m]."""
    scale: NDArray[np.float64]
    """(3,) cells per length [1/m]."""
    shape: NDArray[np.int64]
    """(3,) cells along each axis."""
    wraps: NDArray[np.bool_]
    """(3,) whether the last cell is next to the first: a period, or an axis that is folded."""
    box: NDArray[Any]
    """(3,) period, infinite where there is none [m]; its precision is that of all distances."""


class Cells(NamedTuple):
    """Points in the order of their cells."""

    position: NDArray[Any]
    """(3, n) [m]"""
    row: NDArray[np.int32]
    """(n,) their rows in the order given."""
    key: NDArray[np.uint64]
    """(n,) numbers of their cells, rising."""
    first: NDArray[np.int32]
    """(entries + 1,) the first point whose cell's number, shifted, is not below the entry's."""
    shift: np.uint64
    """Lower bits of a cell's number that the table leaves out."""


def numbers(name: str, given: Any, real: Any = None) -> NDArray[Any]:
    """An array of real numbers. Raises ValueError, with its name, for what is none."""
    try:
        array = np.asarray(given)
        if array.dtype.kind in "biuf":
            return array if real is None else array.astype(real)
    except ValueError:  # Rows of different lengths.
        pass
    kind = type(given).__name__
    raise ValueError(f"{name} must be an array of real numbers, all rows as long, not a {kind}")


def period(box: Any, dimensions: int, real: type) -> NDArray[Any]:
    """The box's edges as three numbers, infinite along open axes.

    `box` is None, one length, or one for each dimension [m]. Raises ValueError unless they are
    above 0.
    """
    edges: NDArray[Any] = np.full(3, np.inf, real)
    if box is not None:
        given = numbers("box", box, real)
        if given.ndim > 1 or given.size not in (1, dimensions):
            raise ValueError(f"box must be one length or {dimensions}, not of shape {given.shape}")
        edges[:dimensions] = given
    if not np.all(edges > 0):
        raise ValueError(f"box = {box!r} must have edges above 0 (infinite along open axes)")
    return edges


@jit(flags=STRICT)
def _take(points: Any, box: Any, position: Any, bounds: Any) -> Any:
    """Write columns of points within the box, and their bounds; returns a row not finite, or -1."""
    for axis in range(3):
        length = box[axis]
        low, high = box.dtype.type(np.inf), -box.dtype.type(np.inf)
        for i in range(points.shape[0]):
            value = points[i, axis] if axis < points.shape[1] else box.dtype.type(0)
            if not np.isfinite(value):
                return i
            if np.isfinite(length) and not (0 <= value < length):
                value -= length * np.floor(value / length)
                if value < 0:
                    value += length
                if value >= length:
                    value = box.dtype.type(0)
            position[axis, i] = value
            low, high = min(low, value), max(high, value)
        bounds[0, axis], bounds[1, axis] = low, high
    return -1


def columns(
    points: NDArray[Any], box: NDArray[Any], name: str
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Points (n, 2) or (n, 3) as columns (3, n) within the box, and their bounds (2, 3) [m].

    Raises ValueError if one is not finite.
    """
    position = np.empty((3, len(points)), box.dtype)
    parts = blocks(len(points), ROWS)
    bounds = np.empty((len(parts), 2, 3), np.float64)

    def take(part: int) -> None:
        rows = slice(*parts[part])
        bad = _take(points[rows], box, position[:, rows], bounds[part])
        if bad >= 0:
            row = parts[part][0] + bad
            raise ValueError(f"{name}[{row}] = {points[row].tolist()} is not finite")

    share(take, len(parts))
    if not parts:
        return position, np.zeros((2, 3))
    return position, np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def grid(
    bounds: NDArray[np.float64], radius: float | tuple[float, float, float], box: NDArray[Any]
) -> Grid:
    """Cells for a search within `radius` [m] of points within `bounds` (2, 3) [m].

    With three radii cells have these widths along the axes.

    Cells are wider than the radius by what rounding can move: distances, also across a border,
    which round with the box, and this calculation. An open axis that would have more than 2^20
    cells is folded: parts far from each other share cells, and distances tell them apart. Cells
    then begin at 0 and are as wide as a power of 2, so that no coordinate is too large for them.
    """
    rounding = _ROUNDING[box.dtype.char]
    ends = bounds.tolist()
    widths = radius if isinstance(radius, tuple) else (radius,) * 3
    low, scale, shape, wraps = np.zeros(3), np.empty(3), np.empty(3, np.int64), np.empty(3, bool)
    for axis, edge in enumerate(box.tolist()):  # Three numbers: Python is quicker than NumPy.
        begin, end = ends[0][axis], ends[1][axis]
        periodic = math.isfinite(edge)
        period = edge if periodic else 0.0
        width = widths[axis] * (1 + 2.0**-20) + rounding * period
        count = int(min((period if periodic else end - begin) / width, _ALONG))
        count = min(max(count if periodic else count + 1, 1), _ALONG)
        folded = not periodic and count == _ALONG
        each = 2.0 ** math.floor(-math.log2(width)) if folded else 1 / width
        each = count / period if periodic else each
        if max(abs(begin), abs(end)) * each > _FARTHEST:
            raise ValueError(
                f"radius = {radius} m is too small for points {end - begin:.3g} m apart"
            )
        low[axis] = 0.0 if periodic or folded else begin
        scale[axis], shape[axis], wraps[axis] = each, count, periodic or folded
    return Grid(low, scale, shape, wraps, box)


@jit(flags=STRICT)
def _write_keys(position: Any, grid: Any, key: Any) -> None:
    key[:] = np.uint64(0)
    for axis in (2, 1, 0):
        low, scale, count = grid.low[axis], grid.scale[axis], grid.shape[axis]
        for i in range(key.size):
            place = (np.float64(position[axis, i]) - low) * scale
            if grid.wraps[axis]:
                place -= count * np.floor(place / count)
            cell = min(np.int64(place), count - 1)
            key[i] = key[i] * np.uint64(count) + np.uint64(cell)


@jit
def _gather(position: Any, row: Any, ordered: Any) -> None:
    for axis in range(3):
        for i in range(row.size):
            ordered[axis, i] = position[axis, row[i]]


@jit
def _index(key: Any, begin: Any, shift: Any, last: Any, first: Any) -> None:
    """Entries of the table between the keys of rows from `begin` on and those before them.

    `key` is those rows' keys and, before them, that of the row before, if any.
    """
    skipped = 1 if begin > 0 else 0
    entry = np.int64(key[0] >> shift) + 1 if begin > 0 else np.int64(0)
    for i in range(skipped, key.size):
        bucket = np.int64(key[i] >> shift)
        while entry <= bucket:
            first[entry] = begin + i - skipped
            entry += 1
    if last:
        first[entry:] = begin + key.size - skipped


def keys(position: NDArray[Any], grid: Grid, room: Room | None = None) -> NDArray[np.uint64]:
    """Numbers of the points' cells (n,)."""
    n = position.shape[1]
    parts, key = blocks(n, ROWS), room_for(room, "key", (n,), np.uint64)

    def write(part: int) -> None:
        rows = slice(*parts[part])
        _write_keys(position[:, rows], grid, key[rows])

    share(write, len(parts))
    return key


def sort(position: NDArray[Any], grid: Grid, spare: int = 0, room: Room | None = None) -> Cells:
    """The points (3, n) in the order of (cell, row), with room for some more behind them.

    What is returned is in `room`, if one is given, until it serves again.
    """
    n = position.shape[1]
    parts = blocks(n, ROWS)
    key = keys(position, grid, room)
    total = int(np.prod(grid.shape, dtype=object))
    bits = (total - 1).bit_length()
    ordered = room_for(room, "ordered", (3, n + spare), position.dtype)
    ordered[:, n:] = 0
    if total <= _ENTRIES * n:
        key, row, first = counted_rows(key, total, room)
        shift = 0
    else:
        key, row = sorted_rows(key, bits)
        shift = max(0, bits - (_ENTRIES * max(n, 1)).bit_length())
        first = np.zeros(((total - 1) >> shift) + 2, np.int32)

    def index(part: int) -> None:
        begin, end = parts[part]
        _gather(position, row[begin:end], ordered[:, begin:end])
        if total > _ENTRIES * n:
            _index(key[max(begin - 1, 0) : end], begin, np.uint64(shift), end == n, first)

    share(index, len(parts))
    return Cells(ordered, row, key, first, np.uint64(shift))


@jit(inline=True)
def _around(cell: Any, count: Any, wraps: Any) -> Any:
    """First cell and number of cells next to a cell along an axis; they may go round the end."""
    if not wraps:
        first = max(cell - 1, 0)
        return first, min(cell + 2, count) - first
    if count < 3:
        return np.int64(0), count
    return (cell + count - 1) % count, np.int64(3)


@jit(inline=True)
def first_from(key: Any, cells: Any) -> Any:
    """The first point whose cell's number is not below `key`."""
    entry = np.intp(key >> cells.shift)
    if entry >= cells.first.size - 1:
        return np.int64(cells.key.size)
    low = np.int64(cells.first[entry])
    if cells.shift == np.uint64(0):
        return low
    high = np.int64(cells.first[entry + 1])
    while low < high:
        middle = (low + high) >> 1
        if cells.key[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@jit(inline=True)
def runs_around(key: Any, grid: Any, cells: Any, runs: Any) -> Any:
    """Write begin and end of the runs of points in and next to a cell into `runs` (18, 2).

    Returns how many there are, how many points they hold, and whether distances can be across a
    periodic border.
    """
    nx, ny, nz = grid.shape[0], grid.shape[1], grid.shape[2]
    cell = np.int64(key)
    x, nx_around = _around(cell % nx, nx, grid.wraps[0])
    y, ny_around = _around(cell // nx % ny, ny, grid.wraps[1])
    z, nz_around = _around(cell // (nx * ny), nz, grid.wraps[2])
    crosses = (
        x + nx_around > nx
        or y + ny_around > ny
        or z + nz_around > nz
        or (grid.wraps[0] and nx < 3)
        or (grid.wraps[1] and ny < 3)
        or (grid.wraps[2] and nz < 3)
    )
    number, points = np.int64(0), np.int64(0)
    for k in range(nz_around):
        for j in range(ny_around):
            row = ((z + k) % nz * ny + (y + j) % ny) * nx
            begin, left = x, nx_around
            while left > 0:
                length = min(left, nx - begin)
                low = first_from(np.uint64(row + begin), cells)
                high = first_from(np.uint64(row + begin + length), cells)
                if low < high:
                    runs[number, 0], runs[number, 1] = low, high
                    number += 1
                    points += high - low
                begin, left = np.int64(0), left - length
    return number, points, crosses


@jit(inline=True, flags=STRICT)
def apart(a: Any, b: Any, period: Any, crosses: Any) -> Any:
    """Distance of two coordinates along an axis, |a - b| or what is left of the period [m].

    In nothing but IEEE 754's operations: a pair at the very radius is decided alike wherever and
    by whatever loop it is met.
    """
    distance = abs(a - b)
    if crosses:
        distance = min(distance, period - distance)
    return distance
