"""The same formulas as short machine code: loops over lists of multiply-adds.

Straight-line code of high orders takes long to make, and no longer fits where a processor keeps
code. Here a formula is noted as steps d = a b + c between numbered lanes in memory, and a loop of a
few instructions does one after the other. Long sums of products, nearly all of the work, have a
loop of their own that forms TOGETHER of them in registers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from llvmlite import ir
from numba.core import cgutils

from motes.interact.gravity import lanes as simd
from motes.interact.gravity.lanes import LANES

ROOM = 4096
"""Most lanes that a formula may keep."""

TOGETHER = 4
"""Sums that are formed in registers together, as one would wait for its own last term."""

LONG = ir.IntType(64)
SHORT = ir.IntType(32)


class Note:
    """Lanes that a tape will know: given, a constant, a sum or a product."""

    def __init__(self, tape: Tape, kind: str, *parts: Any) -> None:
        self.tape, self.kind, self.parts = tape, kind, parts
        tape.notes.append(self)

    def _with(self, other: Any, kind: str) -> Note:
        return Note(self.tape, kind, self, self.tape.note(other))

    def __add__(self, other: Any) -> Note:
        return self._with(other, "+")

    def __sub__(self, other: Any) -> Note:
        return self._with(-self.tape.note(other), "+")

    def __mul__(self, other: Any) -> Note:
        return self._with(other, "*")

    def __rmul__(self, other: Any) -> Note:
        return self._with(other, "*")

    def __neg__(self) -> Note:
        return self._with(-1.0, "*")

    def straight(self) -> Any:
        """The lanes now, by straight-line code."""
        if self.kind in "+*":
            a, b = (part.straight() for part in self.parts)
            return a + b if self.kind == "+" else a * b
        return self.parts[0]()

    def needs(self) -> tuple[Note, ...]:
        """What it is made of."""
        return () if self.kind == "given" else self.parts


class Tape:
    """A formula that is being noted, and then played."""

    def __init__(self, builder: Any, element: Any, wire: Callable[..., Any]) -> None:
        self.builder, self.wire = builder, wire
        self.lanes = ir.VectorType(element, LANES)
        self.memory = cgutils.alloca_once(builder, ir.ArrayType(self.lanes, ROOM))
        self.notes: list[Note] = []
        self.constants: dict[float, Note] = {}
        self.place: dict[Note, int] = {}
        self.first: list[Callable[[], None]] = []
        self.kept: list[Note] = []
        self.later: list[Callable[[int], None]] = []

    def note(self, value: Any) -> Note:
        """The lanes of a number or a note."""
        if isinstance(value, Note):
            return value
        if value not in self.constants:
            lanes = self.wire(self.builder, simd.constant(self.lanes.element, value))
            self.constants[value] = self.given(lambda: lanes)
        return self.constants[value]

    def given(self, read: Callable[[], Any]) -> Note:
        """A note of lanes, or of a number for each, that are read before the tape is played."""
        note = self.known(read)
        self.first.append(lambda: self.write(self.place[note], read()))
        return note

    def known(self, read: Callable[[], Any]) -> Note:
        """A note of lanes that something else writes before the tape is played."""
        note = Note(self, "given", read)
        self.place[note] = len(self.place)
        return note

    def write(self, place: Any, wire: Any) -> None:
        """Put lanes, or a number for each of them, into memory."""
        wide = isinstance(wire.value.type, ir.VectorType)
        lanes = wire.value if wide else simd.splat(self.builder, wire.value)
        self.builder.store(lanes, self._pointer(place))

    def read(self, place: Any) -> Any:
        """Lanes from memory."""
        return self.wire(self.builder, self.builder.load(self._pointer(place)))

    def sums(self, sums: list[list[tuple[Any, Any]]]) -> list[Note]:
        """Sums of products."""
        return [
            Note(self, "sum", *(self.note(part) for pair in pairs for part in pair))
            for pairs in sums
        ]

    def each(self, count: int, step: int, body: Callable[[Any], None]) -> None:
        """Code of a loop of `count` rounds, whose body is given 0, step, 2 step ..."""
        with cgutils.for_range(self.builder, ir.Constant(LONG, count)) as loop:
            body(self.builder.mul(loop.index, ir.Constant(LONG, step)))

    def keep(self, notes: list[Note], use: Callable[[int], None]) -> None:
        """Have some lanes end to end once the tape has been played; `use` is told where."""
        self.kept += notes
        place = len(self.kept) - len(notes)
        self.later.append(lambda first: use(first + place))

    def play(self) -> None:
        """Write the code."""
        self.note(1.0)
        self.note(0.0)
        for first in self.first:
            first()
        sums = [note for note in self.notes if note.kind == "sum"]
        before: set[Note] = set()
        for note in reversed(self.notes):
            if note.kind == "sum" or note in before:
                before.update(note.needs())
        others = [note for note in self.notes if note.kind in "+*"]
        self._steps([note for note in others if note in before])
        self._sums(sums)
        self._steps([note for note in others if note not in before])
        size = len(self.place)
        one, zero = self.constants[1.0], self.constants[0.0]
        copies = [(size + k, note, one, zero) for k, note in enumerate(self.kept)]
        assert size + len(copies) <= ROOM, "the formula needs more room"
        self._loop([(d, *map(self.place.__getitem__, parts)) for d, *parts in copies])
        for use in self.later:
            use(size)

    def _steps(self, notes: list[Note]) -> None:
        """Code for sums and products of two, where a product of one use joins the sum."""
        uses = Counter(part for note in self.notes for part in note.needs())
        uses.update(self.kept)
        one, zero = self.constants[1.0], self.constants[0.0]
        joined: dict[Note, Note] = {}
        for note in notes:
            for part in note.parts[::-1] if note.kind == "+" else ():
                if part.kind == "*" and uses[part] == 1 and note not in joined:
                    joined[note] = part
        inside = set(joined.values())
        steps = []
        for note in notes:
            if note in inside or not uses[note]:
                continue
            a, b = note.parts
            if note in joined:
                parts = (*joined[note].parts, a if joined[note] is b else b)
            else:
                parts = (a, b, zero) if note.kind == "*" else (a, one, b)
            places = [self.place[part] for part in parts]
            self.place[note] = len(self.place)
            steps.append((self.place[note], *places))
        self._loop(steps)

    def _loop(self, steps: list[tuple[int, ...]]) -> None:
        table = self._table([place for step in steps for place in step])

        def step(first: Any) -> None:
            d, a, b, c = (self._pointer(self._entry(table, first, k)) for k in range(4))
            self.builder.store(self._fused(*map(self.builder.load, (a, b, c))), d)

        self.each(len(steps), 4, step)

    def _sums(self, sums: list[Note]) -> None:
        """Code for sums of products, TOGETHER at a time, with products of zeros at their ends."""
        zero = self.place[self.constants[0.0]]
        places: list[int] = []
        groups: list[int] = []
        for first in range(0, len(sums), TOGETHER):
            some = sums[first : first + TOGETHER]
            lists = [[self.place[part] for part in note.parts] for note in some]
            lists += [[]] * (TOGETHER - len(some))
            long = max(map(len, lists))
            groups += [len(places) // (2 * TOGETHER), long // 2]
            for k in range(0, long, 2):
                for pairs in lists:
                    places += pairs[k : k + 2] or (zero, zero)
        begin = len(self.place)
        for k, note in enumerate(sums):
            self.place[note] = begin + k
        for k in range(-len(sums) % TOGETHER):  # Places for sums of nothing.
            self.place[Note(self, "given", None)] = begin + len(sums) + k
        table, ranges = self._table(places), self._table(groups)
        builder = self.builder
        totals = [cgutils.alloca_once(builder, self.lanes) for _ in range(TOGETHER)]

        def group(number: Any) -> None:
            for total in totals:
                builder.store(ir.Constant(self.lanes, None), total)
            start, count = (builder.zext(self._entry(ranges, number, k), LONG) for k in (0, 1))
            with cgutils.for_range(builder, count) as loop:
                row = builder.mul(builder.add(start, loop.index), ir.Constant(LONG, 2 * TOGETHER))
                for k, total in enumerate(totals):
                    a, b = (
                        builder.load(self._pointer(self._entry(table, row, 2 * k + side)))
                        for side in (0, 1)
                    )
                    builder.store(self._fused(a, b, builder.load(total)), total)
            for k, total in enumerate(totals):
                place = builder.add(
                    builder.mul(number, ir.Constant(LONG, TOGETHER // 2)),
                    ir.Constant(LONG, begin + k),
                )
                builder.store(builder.load(total), self._pointer(place))

        self.each(len(groups) // 2, 2, group)

    def _fused(self, a: Any, b: Any, c: Any) -> Any:
        flags = ("contract",)
        return self.builder.fadd(self.builder.fmul(a, b, flags=flags), c, flags=flags)

    def _table(self, numbers: list[int]) -> Any:
        """A list of numbers beside the code."""
        module, kind = self.builder.module, ir.ArrayType(SHORT, len(numbers))
        table = cgutils.add_global_variable(module, kind, module.get_unique_name("tape"))
        table.initializer = ir.Constant(kind, numbers)
        table.global_constant, table.linkage = True, "internal"
        return table

    def _entry(self, table: Any, first: Any, k: int) -> Any:
        place = self.builder.add(first, ir.Constant(LONG, k))
        return self.builder.load(self.builder.gep(table, [ir.Constant(LONG, 0), place]))

    def _pointer(self, place: Any) -> Any:
        where = ir.Constant(LONG, place) if isinstance(place, int) else place
        if where.type == SHORT:
            where = self.builder.zext(where, LONG)
        return self.builder.gep(self.memory, [ir.Constant(LONG, 0), where])


class Array:
    """An array in a formula that is noted: read first, written once the tape has been played."""

    def __init__(self, tape: Tape, array: Any) -> None:
        self.tape, self.array = tape, array

    def __getitem__(self, k: int) -> Note:
        return self.tape.given(lambda: self.array[k])

    def __setitem__(self, k: int, note: Note) -> None:
        def use(place: int) -> None:
            self.array[k] = self.tape.read(place)

        self.tape.keep([note], use)

    def rows(self, count: int) -> list[Note]:
        """The first rows."""
        tape = self.tape
        notes = [tape.known(partial(self.array.__getitem__, k)) for k in range(count)]
        place = tape.place[notes[0]]

        def read(k: Any) -> None:
            tape.write(tape.builder.add(k, ir.Constant(LONG, place)), self.array[k])

        tape.first.append(lambda: tape.each(count, 1, read))
        return notes

    def write(self, notes: list[Note], change: Callable[[Any], Any]) -> None:
        """Write what becomes of some notes to the first rows."""
        tape = self.tape

        def use(place: int) -> None:
            def row(k: Any) -> None:
                found = tape.read(tape.builder.add(k, ir.Constant(LONG, place)))
                self.array[k] = change(found)

            tape.each(len(notes), 1, row)

        tape.keep(notes, use)

    def gathered(
        self, chosen: Array, count: int, step: int, gathering: Callable[..., Any]
    ) -> list[Note]:
        """Columns of rows `chosen` of a table; `gathering` makes the code for `step` of them."""
        tape, whole = self.tape, -(-count // step) * step

        def now(k: int) -> Any:
            return gathering(self.array, chosen.array)(k - k % step)[k % step]

        notes = [tape.known(partial(now, k)) for k in range(whole)]
        place = tape.place[notes[0]]

        def read() -> None:
            some = gathering(self.array, chosen.array)

            def part(first: Any) -> None:
                for k, wire in enumerate(some(first)):
                    tape.write(tape.builder.add(first, ir.Constant(LONG, place + k)), wire)

            tape.each(whole // step, step, part)

        tape.first.append(read)
        return notes[:count]

    def scattered(self, notes: Any, scatter: Callable[..., None]) -> None:
        """Write columns of a table; `scatter` makes the code for LANES of them."""
        tape = self.tape
        whole = [*notes, *[notes[-1]] * (-len(notes) % LANES)]

        def use(place: int) -> None:
            def block(first: Any) -> None:
                some = [
                    tape.read(tape.builder.add(first, ir.Constant(LONG, place + k)))
                    for k in range(LANES)
                ]
                scatter(self.array, some, first)

            tape.each(len(whole) // LANES, LANES, block)

        tape.keep(whole, use)
