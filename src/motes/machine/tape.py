"""The same formulas as short machine code: loops over lists of multiply-adds.

Straight-line code of high orders takes long to make, and no longer fits where a processor keeps
code. Here a formula is noted as steps d = a b + c between numbered lanes in memory, and a loop of a
few instructions does one after the other. Long sums of products, nearly all of the work, have a
loop of their own that forms TOGETHER of them in registers.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from motes.machine.block import literal
from motes.machine.kinds import INT, INT32, Number
from motes.machine.values import Scalar

ROOM = 4096
"""Most lanes that a formula may keep."""

TOGETHER = 4
"""Sums that are formed in registers together, as one would wait for its own last term."""


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

    def __init__(self, writer: Any, lanes: Number, wire: Callable[..., Any]) -> None:
        self.writer, self.lanes, self.wire = writer, lanes, wire
        self.memory = writer.room(lanes.over(1), ROOM * lanes.lanes)
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
            lanes = self.wire(self.writer, literal(value, self.lanes))
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
        self._store(self.writer.cast(wire.value, self.lanes).text, place)

    def read(self, place: Any) -> Any:
        """Lanes from memory."""
        return self.wire(self.writer, Scalar(self.lanes, self._load(place)))

    def sums(self, sums: list[list[tuple[Any, Any]]]) -> list[Note]:
        """Sums of products."""
        return [
            Note(self, "sum", *(self.note(part) for pair in pairs for part in pair))
            for pairs in sums
        ]

    def each(self, count: int, step: int, body: Callable[[str], None]) -> None:
        """Code of a loop of `count` rounds, whose body is given 0, step, 2 step ..."""
        self.writer.counted(str(count), lambda index: body(self.times(index.text, step)))

    def times(self, number: str, factor: int) -> str:
        """A product of integers in registers."""
        return str(self.writer.do(f"mul nsw i64 {number}, {factor}"))

    def plus(self, number: str, more: Any) -> str:
        """A sum of integers in registers."""
        return str(self.writer.do(f"add nsw i64 {number}, {more}"))

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

        def step(first: str) -> None:
            d, a, b, c = (self._entry(table, first, k) for k in range(4))
            self._store(self._fused(*(self._load(place) for place in (a, b, c))), d)

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
        writer, kind = self.writer, self.lanes.llvm
        totals = [writer.room(self.lanes.over(1), self.lanes.lanes) for _ in range(TOGETHER)]
        align = f"align {self.lanes.bytes}"

        def group(number: str) -> None:
            for total in totals:
                writer.line(f"store {kind} zeroinitializer, ptr {total}, {align}")
            start, count = (self._entry(ranges, number, k) for k in (0, 1))

            def round(index: Any) -> None:
                row = self.times(self.plus(start, index.text), 2 * TOGETHER)
                for k, total in enumerate(totals):
                    a, b = (self._load(self._entry(table, row, 2 * k + s)) for s in (0, 1))
                    old = writer.do(f"load {kind}, ptr {total}, {align}")
                    writer.line(f"store {kind} {self._fused(a, b, old)}, ptr {total}, {align}")

            writer.counted(count, round)
            for k, total in enumerate(totals):
                place = self.plus(self.times(number, TOGETHER // 2), begin + k)
                self._store(writer.do(f"load {kind}, ptr {total}, {align}"), place)

        self.each(len(groups) // 2, 2, group)

    def _fused(self, a: str, b: str, c: str) -> str:
        kind = self.lanes.llvm
        product = self.writer.do(f"fmul contract {kind} {a}, {b}")
        return str(self.writer.do(f"fadd contract {kind} {product}, {c}"))

    def _table(self, numbers: list[int]) -> str:
        """A list of numbers beside the code."""
        kind = f"[{len(numbers)} x i32]"
        content = f"{kind} [{', '.join(f'i32 {n}' for n in numbers)}]" if numbers else f"{kind} []"
        name = f"@tape_{hashlib.sha256(content.encode()).hexdigest()[:24]}"
        self.writer.declare(f"{name} = internal constant {content}")
        return name

    def _entry(self, table: str, first: str, k: int) -> str:
        at = self.plus(first, k)
        at = self.writer.do(f"getelementptr inbounds i32, ptr {table}, i64 {at}")
        number = Scalar(INT32, self.writer.do(f"load i32, ptr {at}"))
        return str(self.writer.cast(number, INT).text)

    def _pointer(self, place: Any) -> str:
        kind = self.lanes.llvm
        at = self.writer.do(f"getelementptr inbounds {kind}, ptr {self.memory}, i64 {place}")
        return f"ptr {at}, align {self.lanes.bytes}"

    def _load(self, place: Any) -> str:
        return str(self.writer.do(f"load {self.lanes.llvm}, {self._pointer(place)}"))

    def _store(self, text: str, place: Any) -> None:
        self.writer.line(f"store {self.lanes.llvm} {text}, {self._pointer(place)}")


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
            tape.write(tape.plus(k, place), self.array[k])

        tape.first.append(lambda: tape.each(count, 1, read))
        return notes

    def write(self, notes: list[Note], change: Callable[[Any], Any]) -> None:
        """Write what becomes of some notes to the first rows."""
        tape = self.tape

        def use(place: int) -> None:
            def row(k: Any) -> None:
                found = tape.read(tape.plus(k, place))
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
                    tape.write(tape.plus(first, place + k), wire)

            tape.each(whole // step, step, part)

        tape.first.append(read)
        return notes[:count]

    def scattered(self, notes: Any, scatter: Callable[..., None]) -> None:
        """Write columns of a table; `scatter` makes the code for tape.lanes.lanes of them."""
        tape = self.tape
        whole = [*notes, *[notes[-1]] * (-len(notes) % tape.lanes.lanes)]

        def use(place: int) -> None:
            def block(first: Any) -> None:
                some = [
                    tape.read(tape.plus(first, place + k))
                    for k in range(tape.lanes.lanes)
                ]
                scatter(self.array, some, first)

            tape.each(len(whole) // tape.lanes.lanes, tape.lanes.lanes, block)

        tape.keep(whole, use)
