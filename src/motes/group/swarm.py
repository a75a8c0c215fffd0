"""Gathering laws without lists: particles in cells, all laws of a swarm in one loop.

A swarm is a set of laws with one grid of cells, whose cells are as wide as the longest reach.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.gather import WIDTH, gather_kernel, read
from motes.compile.pairs import Law
from motes.interact.arrange import Box, wrapped
from motes.interact.cells import MOST_RUNS, Cells, Grid, grid, sort
from motes.jit import blocks, share

ROWS = 1 << 15
"""Rows of one task of a loop that is quick."""

TARGETS = 1 << 13
"""Targets of one task of sums."""

FEWEST = 4
"""Cells along a period below which images would be met twice."""

UNTIDY = 1 << 12
"""Rows that two neighbours in a cell may be apart before rows had better move."""

Array = NDArray[Any]
Laws = Sequence[tuple[Law, tuple[str, ...], tuple[str, ...]]]


def _room(points: int, fields: int, real: type) -> tuple[Array, ...]:
    """Memory of one task: runs, slots, candidates, marks, choice, and the chosen."""
    return (
        np.empty((MOST_RUNS, 2), np.int64),
        np.empty(points, np.uint32),
        np.empty((3, points), real),
        np.empty(points, np.uint8),
        np.empty(points, np.uint32),
        np.empty((fields, points), real),
    )


class Swarm:
    """Evaluates gathering laws that share cells."""

    def __init__(self, laws: Laws, real: type, periodic: Box) -> None:
        self.laws, self.real, self.periodic = list(laws), real, periodic
        self.systems = sorted({n for _, targets, sources in laws for n in (*targets, *sources)})
        self._kernels: dict[tuple[int, ...], Any] = {}

    def fits(self, time: float) -> bool:
        """Whether the periods hold enough cells."""
        reach = max(law.reach(time) for law, _, _ in self.laws)
        return bool(self.periodic.shortest >= FEWEST * reach * (1 + 1e-5))

    def push(
        self, bodies: Mapping[str, Any], pushes: Mapping[str, Array], untidy: set[str]
    ) -> None:
        """Add the laws' accelerations (3, n) [m/s2] to pushes; note whose rows are scattered."""
        time = next(iter(bodies.values())).time
        positions = {name: self._inside(bodies[name]) for name in self.systems}
        cut = self._grid(list(positions.values()), max(law.reach(time) for law, _, _ in self.laws))
        cells = {name: sort(position, cut) for name, position in positions.items()}
        for name, found in cells.items():
            apart = np.abs(np.diff(found.row)) > UNTIDY
            if 4 * np.count_nonzero(apart) > apart.size:
                untidy.add(name)
        packed: dict[tuple[str, str], Array] = {}
        for target in self.systems:
            acting = [one for one in self.laws if target in one[1]]
            sources = sorted({name for _, _, names in acting for name in names})
            if not acting or not cells[target].row.size:
                continue
            n = cells[target].row.size
            sums: dict[int, Array] = {}
            for law, _, _ in acting:
                sums[id(law)] = np.zeros((law.sums(), n), self.real)
            for source in sources:
                felt = [law for law, _, names in acting if source in names]
                part = self._gather(felt, target, source, cells, cut, bodies, packed, time)
                place = 0
                for law in felt:
                    sums[id(law)] += part[place : place + law.sums()]
                    place += law.sums()
            for law, _, _ in acting:
                self._finish(law, sums[id(law)], target, cells, bodies, packed, time, pushes)

    def order(self, body: Any) -> NDArray[np.int32]:
        """Rows of one system in the order of cells."""
        position = self._inside(body)
        reach = max(law.reach(body.time) for law, _, _ in self.laws)
        return sort(position, self._grid([position], reach)).row

    def _inside(self, body: Any) -> Array:
        found: Array = np.array(body.position[:, : body.alive], self.real)
        if not np.isfinite(found).all():
            found = np.where(np.isfinite(found), found, 0).astype(self.real)
        wrapped(found, self.periodic)
        return found

    def _grid(self, positions: list[Array], reach: float) -> Grid:
        """Cells that begin at the low corner of what there is, or of the box."""
        inside = [p for p in positions if p.shape[1]]
        low = np.min([p.min(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
        high = np.max([p.max(axis=1) for p in inside], axis=0) if inside else np.zeros(3)
        size = self.periodic.size
        box: Array = np.where(size > 0, size, np.inf).astype(self.real)
        low = np.where(size > 0, 0.0, low)
        cut = grid(np.stack([low, np.where(size > 0, size, high)]).astype(float), reach, box)
        return cut._replace(low=np.where(size > 0, self.periodic.low, cut.low))

    def _column(
        self, name: str, key: str, cells: Mapping[str, Cells], bodies: Mapping[str, Any],
        packed: dict[tuple[str, str], Array],
    ) -> Array:  # fmt: skip
        """A number of every particle in the order of cells."""
        if key in ("x", "y", "z"):
            column: Array = cells[name].position["xyz".index(key)]
            return column
        if (name, key) not in packed:
            values, row = bodies[name].column(key), cells[name].row
            out = packed[name, key] = np.empty(row.size, self.real)
            parts = blocks(row.size, ROWS)

            def take(k: int) -> None:
                rows = slice(*parts[k])
                out[rows] = values[row[rows]]

            share(take, len(parts))
        return packed[name, key]

    def _gather(
        self, laws: list[Law], target: str, source: str, cells: Mapping[str, Cells], cut: Grid,
        bodies: Mapping[str, Any], packed: dict[tuple[str, str], Array], time: float,
    ) -> Array:  # fmt: skip
        """Sums of some laws (numbers, targets) over one source."""
        which = tuple(id(law) for law in laws)
        if which not in self._kernels:
            self._kernels[which] = gather_kernel(laws)
        kernel, other = self._kernels[which], read(laws, 1)
        mine = tuple(self._column(target, key, cells, bodies, packed) for key in read(laws, 0))
        theirs = np.stack([self._column(source, key, cells, bodies, packed) for key in other])
        numbers = tuple(law.numbers(time, self.real) for law in laws)
        limits: Array = np.array([self.real(law.reach(time)) ** 2 for law in laws], self.real)
        n = cells[target].row.size
        out: Array = np.empty((sum(law.sums() for law in laws), n), self.real)
        parts = blocks(n, TARGETS)

        def sweep(k: int) -> None:
            begin, end = parts[k]
            points = 512
            while begin < end:
                room = _room(2 * points + WIDTH, len(other), self.real)
                begin, points = kernel(
                    numbers, limits, cut, mine, cells[target].key, theirs, cells[source],
                    source == target, begin, end, room, out,
                )  # fmt: skip

        share(sweep, len(parts))
        return out

    def _finish(
        self, law: Law, sums: Array, target: str, cells: Mapping[str, Cells],
        bodies: Mapping[str, Any], packed: dict[tuple[str, str], Array], time: float,
        pushes: Mapping[str, Array],
    ) -> None:  # fmt: skip
        mine = tuple(self._column(target, key, cells, bodies, packed) for key in law.fields[0])
        numbers, order = law.numbers(time, self.real), cells[target].row
        parts = blocks(order.size, ROWS)

        def finish(k: int) -> None:
            law.finish(numbers, mine, sums, order, pushes[target], *parts[k])

        share(finish, len(parts))
