"""Gathering laws without lists: particles in cells, laws that share their sources in one loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.gather import LANES, Gathering
from motes.compile.pairs import Law
from motes.interact.arrange import Box
from motes.interact.cells import Cells, Grid, keys, sort
from motes.interact.counting_sort import Room, room_for
from motes.interact.runs import inside, pick, rows_of_cells, rows_wanted
from motes.jit import blocks, share

ROWS = 1 << 15
"""Rows of one task of a loop that is quick."""

MOST, LEAST = 1 << 15, 1 << 8
"""Targets of one task of sums."""

ROOM = 512
"""Points near a few targets that there is room for at first; it grows when there are more."""

SMALL = 1 << 14
"""Rows up to which NumPy sorts numbers of cells in less time than all is sorted in."""

FEWEST = 5
"""Longest reaches along a period below which images would be met twice."""

UNTIDY = 1 << 12
"""Rows that two neighbours in a cell may be apart before rows had better move."""

EVERY = 16
"""Every so many rows are looked at to see whether they are tidy."""

Array = NDArray[Any]
_Part = tuple[Callable[..., None], Array]
"""A function of room and a part, and where it says how far it came and what room it needs."""

Laws = Sequence[tuple[Law, tuple[str, ...], tuple[str, ...]]]


@dataclass(eq=False)
class _Sorted:
    """One system in the order of its cells."""

    grid: Grid
    cells: Cells
    body: Any
    room: Room
    columns: dict[str, Array] = field(default_factory=dict)

    def column(self, key: str) -> Array:
        """A number of every particle, with room for lanes beyond the last."""
        if key in ("x", "y", "z"):
            axis: Array = self.cells.position["xyz".index(key)]
            return axis
        if key not in self.columns:
            row = self.cells.row
            real = self.cells.position.dtype
            out = self.columns[key] = room_for(
                self.room, f"column {key}", (row.size + LANES,), real
            )
            out[row.size :] = 0
            values, parts = self.body.column(key), blocks(row.size, ROWS)

            def take(k: int) -> None:
                rows = slice(*parts[k])
                pick(values, row[rows], out[rows])

            share(take, len(parts))
        return self.columns[key]

    @property
    def along(self) -> int:
        """Cells in a row."""
        return int(self.grid.shape[0])

    @property
    def untidy(self) -> bool:
        """Whether many of those next to one another are far apart in memory."""
        row = self.cells.row
        if row.size <= UNTIDY:
            return False
        apart = np.abs(row[1::EVERY] - row[:-1:EVERY]) > UNTIDY
        return bool(4 * np.count_nonzero(apart) > apart.size)


class Swarm:
    """Evaluates gathering laws."""

    def __init__(self, laws: Laws, real: type, periodic: Box) -> None:
        self.laws, self.real, self.periodic = list(laws), real, periodic
        self.systems = sorted({n for _, targets, sources in laws for n in (*targets, *sources)})
        size: Array = periodic.size.astype(real)
        edges: Array = np.where(size > 0, size, np.inf).astype(real)
        self._box: tuple[Array, ...] = periodic.low.astype(real), size, edges
        self._slots: Array = np.empty(0, np.int32)
        self._nobody: Array = np.empty(0, np.int32)
        self._numbers: dict[Gathering, Array] = {}
        self._room = ROOM
        self._rooms: dict[str, Room] = {}
        self._alike: list[tuple[Gathering, str, tuple[str, ...]]] = []
        for target in self.systems:
            felt: dict[tuple[str, ...], list[Law]] = {}
            for law, targets, sources in self.laws:
                if target in targets:
                    felt.setdefault(sources, []).append(law)
            self._alike += [(Gathering(some), target, sources) for sources, some in felt.items()]

    def fits(self, time: float) -> bool:
        """Whether the periods are long enough."""
        reach = max(law.reach(time) for law, _, _ in self.laws)
        return bool(self.periodic.shortest >= FEWEST * reach * (1 + 1e-5))

    def prepare(self) -> None:
        """Compile the laws, the last first: who needs them meanwhile begins with the first."""
        for gathering, _, _ in reversed(self._alike):
            gathering.prepare(self.real)

    def push(
        self, bodies: Mapping[str, Any], pushes: Mapping[str, Array], untidy: set[str]
    ) -> None:
        """Add the laws' accelerations (3, n) [m/s2] to pushes; note whose rows are scattered."""
        time = next(iter(bodies.values())).time
        swarm = {name: self._sorted(bodies[name]) for name in self.systems}
        untidy |= {name for name, found in swarm.items() if found.untidy}
        most = max(found.cells.row.size for found in swarm.values()) + LANES
        if self._slots.size < most:
            self._slots = np.arange(2 * most, dtype=np.int32)
            self._nobody = np.full(2 * most, -1, np.int32)
        calls: dict[str, list[_Part]] = {}
        for gathering, target, sources in self._alike:
            if swarm[target].cells.row.size:
                some = [swarm[name] for name in sources]
                mine = self._calls(gathering, swarm[target], some, time, pushes[target])
                calls.setdefault(target, []).extend(mine)
        tasks = [
            (calls[name], k, *part)
            for name in calls
            for k, part in enumerate(_parts(swarm[name].cells.row.size))
        ]

        def gather(number: int) -> None:
            some, k, begin, end = tasks[number]
            for call, state in some:  # Sums over all sources of one law, then of the next.
                at, room = begin, self._room
                while at < end:
                    call(room, k, at, end)
                    at, needed = state[k].tolist()
                    room = self._room = max(room, 2 * needed)

        share(gather, len(tasks))

    def order(self, body: Any) -> NDArray[np.int32]:
        """Rows of one system in the order of cells."""
        return self._sorted(body).cells.row

    def _sorted(self, body: Any) -> _Sorted:
        """A system in cells for the longest of the reaches with which it feels itself, if any."""
        name, time, n, real = body.name, body.time, body.alive, self.real
        own = [law for law, targets, sources in self.laws if name in targets and name in sources]
        reach = max(law.reach(time) for law in own or [law for law, _, _ in self.laws])
        low, size, box = self._box
        room = self._rooms.setdefault(name, {})
        position = room_for(room, "position", (3, n), real)
        parts = blocks(n, ROWS)
        found: Array = np.zeros((max(len(parts), 1), 2, 3), real)

        def take(k: int) -> None:
            rows = slice(*parts[k])
            inside(body.position[:, rows], low, size, position[:, rows], found[k])

        share(take, len(parts))
        ends = [found[:, 0].min(axis=0), found[:, 1].max(axis=0)]
        bounds = np.where(size > 0, [np.zeros(3), self.periodic.size], ends).astype(float)
        cut = rows_of_cells(bounds, reach, 1, box, self.periodic.low)
        few = n <= SMALL
        cells = None if few else sort(position, cut, LANES, room)
        across = rows_wanted(np.sort(keys(position, cut, room)) if cells is None else cells.key)
        if across > 1:
            cut = rows_of_cells(bounds, reach, across, box, self.periodic.low)
        if cells is None or across > 1:
            cells = sort(position, cut, LANES, room)
        return _Sorted(cut, cells, body, room)

    def _calls(
        self, kernel: Gathering, target: _Sorted, sources: Sequence[_Sorted], time: float,
        push: Array,
    ) -> list[_Part]:  # fmt: skip
        """What adds some laws' accelerations to parts of a target, for one source after another."""
        n, real = target.cells.row.size, self.real
        numbers = self._numbers.get(kernel)
        if numbers is None:
            numbers = kernel.numbers(time, real)
            if all(law.lasting for law in kernel.laws):
                self._numbers[kernel] = numbers
        mine = tuple(target.column(key) for key in kernel.own)
        kept: Array = np.empty((kernel.sums, n + LANES if len(sources) > 1 else 0), real)
        found = []
        for source in sources:
            state = np.zeros((len(_parts(n)), 2), np.int64)
            slot = self._slots if source is target else self._nobody
            theirs = tuple(source.column(key) for key in kernel.other)
            call = kernel.bound(
                numbers, mine, slot, target.cells.key, target.along, theirs, source.grid,
                source.cells, self._slots, source is not sources[0], source is sources[-1], kept,
                target.cells.row, push, state,
            )  # fmt: skip
            found.append((call, state))
        return found


def _parts(n: int) -> list[tuple[int, int]]:
    """Targets of each task of sums; from their number alone, so that threads change nothing."""
    return blocks(n, min(MOST, max(LEAST, -(-n // 8))))
