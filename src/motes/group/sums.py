"""Sums over lists of neighbours: what the laws of a group read, in the order of slots, and calls.

An evaluation is first a list of calls, and then carried out: as long as its arrays are the same it
can be carried out again.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.pairs import Law
from motes.compile.text import AXES
from motes.group.lasting import Body, Class, Lists
from motes.group.renewal import Renewal
from motes.interact.arrange import Arranged, Box, pack, pack_images, packed_values
from motes.jit import BRIEF, even_blocks
from motes.memory import allocate
from motes.repeat import Relay, Repeat, Repeats

RECORDS = "records"
"""Name of the places of all slots, x, y, z and a fourth number that nobody reads."""

NO_MARKS: dict[type, Array] = {real: np.empty((0, 4), real) for real in (np.float32, np.float64)}
"""Marks of nobody, by type of numbers."""

Array = NDArray[Any]
Call = Callable[[], None]
Packed = dict[str, dict[str, Array]]
"""Columns by system and name, in the order of slots."""


@dataclass
class Places:
    """Calls that write where everybody is."""

    packed: Packed
    calls: Sequence[Call]
    ways: Array
    """Squares of the longest ways (k, 2) since lists were built and shortened."""
    lasting: bool
    """Whether all that is read, besides where they are, is the same as long as the lists hold."""
    read: Sequence[Any]
    """The arrays that it is about."""
    renewal: Renewal | None = None
    """Calls that shorten lists anew."""

    def __call__(self) -> tuple[float, float]:
        """Write; returns how far one has moved since the lists were built, and shortened [m]."""
        for call in self.calls:
            call()
        moved, since = _most(self.ways)
        return math.sqrt(moved), math.sqrt(since)


def _most(ways: Array) -> list[float]:
    """The highest of each column, or not a number where there is one.

    Of a few rows in less time than NumPy takes to begin.
    """
    if len(ways) > 64:
        most: list[float] = ways.max(axis=0).tolist()
        return most
    columns = zip(*ways.tolist(), strict=True)
    return [max(column) if sum(column) >= 0 else math.nan for column in columns]


class Plan:
    """An evaluation that can be carried out again while lists and arrays are the same."""

    def __init__(
        self, lists: Lists, places: Places, sums: Sequence[Repeat], time: float,
        bodies: dict[str, Body], pushes: dict[str, Array],
    ) -> None:  # fmt: skip
        self.lists, self.places, self._sums, self.time = lists, places, sums, time
        self._arrays = [
            (name, bodies[name].motion, pushes[name], kept) for name, kept in lists.kept.items()
        ]

    def fits(self, lists: Lists, bodies: dict[str, Body], pushes: dict[str, Array]) -> bool:
        """Whether lists, particles and arrays are those that it is for."""
        if lists is not self.lists:
            return False
        for name, motion, push, kept in self._arrays:
            body = bodies[name]
            same = body.motion is motion and pushes[name] is push
            if not same or (body.alive, body.rows.deaths) != kept:
                return False
        return True

    def sums(self) -> None:
        """Add the accelerations."""
        for call in self._sums:
            call()

    def relay(self, shared: Class, rooms: dict[Any, Any], relay: Relay, numbers: Array) -> None:
        """Append the evaluation to a relay.

        Lists of particles are chosen anew where they must be; where that cannot be, the relay stops
        with the round's number (rounds, 1) before the sums.
        """
        for call in self.places.calls:
            assert isinstance(call, Repeat)  # Else the plan would not be kept.
            relay.add(call)
        renewal = self.places.renewal
        if renewal is None or renewal.short is not self.lists.short:
            places = {name: columns[RECORDS] for name, columns in self.places.packed.items()}
            renewal = Renewal(self.lists, places, self.places.ways, rooms, relay.stopped)
            self.places.renewal = renewal
        renewal.add(relay, shared, self.lists, self.time, numbers)
        for call in self._sums:
            relay.add(call)

    def renewed(self) -> Lists:
        """The lists as a relay has left them."""
        renewal = self.places.renewal
        if renewal is not None and renewal.held != self.lists.short_radius:
            self.lists = replace(self.lists, short_radius=renewal.held)
        return self.lists


class Sums:
    """Makes the calls of evaluations."""

    def __init__(self, real: type, periodic: Box) -> None:
        self.real = real
        self._period: Array = periodic.size.astype(real)
        self._rooms: dict[Any, tuple[Array, Array]] = {}
        self._columns: dict[str, tuple[Array, dict[str, Array]]] = {}
        self._calls = Repeats()
        self._places: Places | None = None

    def places(self, shared: Class, found: Lists, bodies: dict[str, Body]) -> Places:
        """What writes what the laws of a class read of every system in the order of slots.

        Places come as records (slots + 1, 4), and, as the columns of these, one by one. What was
        made last serves again while it is about the same arrays.
        """
        names = list(shared.fields)
        read: list[Any] = [shared, found.columns]
        for name in names:
            arranged = found.arranged[name]
            records = self._space((name, "x"), (arranged.slots + 1, 4))
            read += [arranged, records, found.marks.get(name), bodies[name].motion]
        known = self._places
        if known is None or not known.lasting or not all(map(operator.is_, known.read, read)):
            known = self._places = self._new_places(shared, found, bodies, read)
        return known

    def _new_places(
        self, shared: Class, found: Lists, bodies: dict[str, Body], read: Sequence[Any]
    ) -> Places:
        """The same, made anew."""
        packed: Packed = {}
        calls: list[Call] = []
        parts = {name: even_blocks(bodies[name].alive) or [(0, 0)] for name in shared.fields}
        ways = self._space(("ways",), (sum(map(len, parts.values())), 2), np.float64)
        lasting, begin = True, 0
        for name, fields in shared.fields.items():
            body, arranged = bodies[name], found.arranged[name]
            records = self._space((name, "x"), (arranged.slots + 1, 4))
            end = begin + len(parts[name])
            mark = found.marks.get(name)
            calls += self._packing(body, arranged, records, mark, ways[begin:end], parts[name])
            begin = end
            columns = packed[name] = self._views(name, records)
            for field in fields:
                kept, size = found.columns.get((name, field)), arranged.slots + 1
                if kept is None and body.lasts(field):
                    kept = found.columns[name, field] = np.empty(size, self.real)
                    packed_values(arranged, body.column(field), kept)
                elif kept is None:
                    kept, lasting = self._space((name, field), (size,)), False
                    calls.append(partial(packed_values, arranged, body.column(field), kept))
                columns[field] = kept
        return Places(packed, calls, ways, lasting, read)

    def _packing(
        self, body: Body, arranged: Arranged, records: Array, mark: Array | None, ways: Array,
        parts: Sequence[tuple[int, int]],
    ) -> list[Repeat]:  # fmt: skip
        """Calls that write a system's places into records, and the longest ways."""
        n, images = arranged.order.size, arranged.ghost_of.size
        numbered = [(k, *part) for k, part in enumerate(parts)]
        if mark is None:
            mark = NO_MARKS[self.real]
        place = arranged.order, arranged.real.position, self._period, mark, records, ways
        image = records, arranged.ghost_of, arranged.image, arranged.shift, n
        return [
            self._calls((body.name, "x"), pack, (body.motion, *place), numbered, n <= BRIEF),
            self._calls(
                (body.name, "images"), pack_images, image, even_blocks(images), images <= BRIEF
            ),
        ]

    def _views(self, name: str, records: Array) -> dict[str, Array]:
        """A system's records, and their columns one by one; the same ones for the same records."""
        known = self._columns.get(name)
        if known is None or known[0] is not records:
            columns = {RECORDS: records, **dict(zip(AXES, records.T, strict=False))}
            known = self._columns[name] = records, columns
        return dict(known[1])

    def _space(self, key: Any, shape: tuple[int, ...], real: Any = None) -> Array:
        """Room that lasts for one evaluation; the same array as before if it has the same shape."""
        room, view = self._rooms.get(key, (None, None))
        if view is None or view.shape != shape:
            size = math.prod(shape)
            if room is None or room.size < size:
                room = allocate((size + size // 8,), real or self.real, "room for neighbours")
            view = room[:size].reshape(shape)
            self._rooms[key] = room, view
        return view

    def summed(
        self, law: Law, what: str, target: str, sources: Iterable[str], time: float, found: Lists,
        packed: Packed,
    ) -> Array:  # fmt: skip
        """Sums (numbers, n) over the neighbours of every particle of a target."""
        out = self._room_of_sums(law, what, target, found)
        for k, source in enumerate(sources):
            head = self._head(law, target, source, time, packed)
            name = law.address, what, target, source
            lists = found.short[target, source]
            self._calls(name, law.sweep(what), (*head, k == 0, out), lists)()
        return out

    def pushing(
        self, law: Law, targets: Iterable[str], sources: Sequence[str], time: float, found: Lists,
        packed: Packed, pushes: dict[str, Array],
    ) -> list[Repeat]:  # fmt: skip
        """Calls that add a law's accelerations (3, n) to pushes, with the last source's sums."""
        calls: list[Repeat] = []
        for target in targets:
            out = self._room_of_sums(law, law.summed, target, found)
            for k, source in enumerate(sources):
                head = *self._head(law, target, source, time, packed), k == 0, out
                kernel = law.sweep()
                if k == len(sources) - 1:
                    order, push = found.arranged[target].order, pushes[target]
                    kernel, head = law.pushing, (*head, order, push, law.numbers(time, self.real))
                name = law.address, target, source
                calls.append(self._calls(name, kernel, head, found.short[target, source]))
        return calls

    def _room_of_sums(self, law: Law, what: str, target: str, found: Lists) -> Array:
        width, n = law.sums(what), found.arranged[target].order.size
        return self._space(("sums", width, target), (width, n))

    def _head(
        self, law: Law, target: str, source: str, time: float, packed: Packed
    ) -> tuple[Any, ...]:
        """What all loops of a law over the neighbours of a target begin with."""
        own, other = law.fields[0], [name for name in law.fields[1] if name not in AXES]
        mine = tuple(packed[target][name] for name in own)
        theirs = tuple(packed[source][name] for name in other)
        numbers = law.numbers(time, self.real, (target, source))
        limit = self.real(law.reach(time)) ** 2
        return numbers, mine, packed[source][RECORDS], theirs, limit
