"""The same formulas as short machine code: a loop over a list of multiply-adds.

Straight-line code of high orders takes long to make, and no longer fits where a processor keeps
code. Here a formula is noted as steps d = a b + c between numbered lanes in memory, and a loop of a
few instructions does one after the other. Steps of different sums alternate, so that a processor
need not wait for one before it begins the next.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils

from motes.interact.gravity import lanes as simd
from motes.interact.gravity.lanes import LANES

ROOM = 2048
"""Most lanes that a formula may keep."""

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
        return self + other * -1.0

    def __mul__(self, other: Any) -> Note:
        return self._with(other, "*")

    __rmul__ = __mul__

    def __neg__(self) -> Note:
        return self * -1.0

    def straight(self) -> Any:
        """The lanes now, by straight-line code."""
        if self.kind in "+*":
            a, b = (part.straight() for part in self.parts)
            return a + b if self.kind == "+" else a * b
        return self.parts[0]


class Tape:
    """A formula that is being noted, and then played."""

    def __init__(self, builder: Any, element: Any, wire: Callable[..., Any]) -> None:
        self.builder, self.wire = builder, wire
        self.lanes = ir.VectorType(element, LANES)
        self.memory = cgutils.alloca_once(builder, ir.ArrayType(self.lanes, ROOM))
        self.notes: list[Note] = []
        self.constants: dict[float, Note] = {}
        self.place: dict[Note, int] = {}
        self.later: list[tuple[list[Note], Callable[[list[Any]], None]]] = []

    def note(self, value: Any) -> Note:
        """The lanes of a number or a note."""
        if isinstance(value, Note):
            return value
        if value not in self.constants:
            lanes = self.wire(self.builder, simd.constant(self.lanes.element, value))
            self.constants[value] = self.given(lanes)
        return self.constants[value]

    def given(self, wire: Any) -> Note:
        """A note of lanes, or of a number in each lane, that are known before the tape is played."""
        note = Note(self, "given", wire)
        lanes = wire.value
        if not isinstance(lanes.type, ir.VectorType):
            lanes = simd.splat(self.builder, lanes)
            note.parts = (self.wire(self.builder, lanes),)
        self.place[note] = len(self.place)
        self.builder.store(lanes, self._pointer(ir.Constant(SHORT, self.place[note])))
        return note

    def keep(self, notes: list[Note], use: Callable[[list[Any]], None]) -> None:
        """Do something with some lanes once the tape has been played."""
        self.later.append((notes, use))

    def play(self) -> None:
        """Write the code of the loop, and of what follows."""
        kept = [note for notes, _ in self.later for note in notes]
        self._loop([place for step in self._steps(kept) for place in step])
        for notes, use in self.later:
            places = [self._pointer(ir.Constant(SHORT, self.place[note])) for note in notes]
            use([self.wire(self.builder, self.builder.load(place)) for place in places])

    def _steps(self, kept: list[Note]) -> list[tuple[int, int, int, int]]:
        """d, a, b, c of each step."""
        one, zero = self.note(1.0), self.note(0.0)
        uses: dict[Note, int] = dict.fromkeys(self.notes, 0)
        for note in kept:
            uses[note] += 1
        for note in reversed(self.notes):
            if uses[note] and note.kind in "+*":
                for part in note.parts:
                    uses[part] += 1
        steps: list[tuple[Note, Note, Note, Note]] = []
        joined: set[Note] = set()
        for note in self.notes:
            if note.kind == "+" and uses[note]:
                for product in note.parts[::-1]:
                    if product.kind == "*" and uses[product] == 1:
                        joined.add(product)
                        break
        for note in self.notes:
            if not uses[note] or note.kind == "given" or note in joined:
                continue
            a, b = note.parts
            if note.kind == "*":
                steps.append((note, a, b, zero))
            elif b in joined:
                steps.append((note, *b.parts, a))
            elif a in joined:
                steps.append((note, *a.parts, b))
            else:
                steps.append((note, a, one, b))
        return self._placed(steps, kept)

    def _placed(
        self, steps: list[tuple[Note, Note, Note, Note]], kept: list[Note]
    ) -> list[tuple[int, int, int, int]]:
        """Places of all notes in memory, each taken again after its last use."""
        last = {note: k for k, step in enumerate(steps) for note in step[1:]}
        last |= dict.fromkeys([*kept, *self.constants.values()], len(steps))
        size, free, rows = len(self.place), [], []
        for k, (note, *parts) in enumerate(steps):
            places = [self.place[part] for part in parts]
            free += [self.place[part] for part in dict.fromkeys(parts) if last[part] == k]
            if not free:
                free, size = [size], size + 1
            self.place[note] = free.pop()
            rows.append((self.place[note], *places))
        assert size <= ROOM, f"{size} lanes do not fit"
        return rows

    def _loop(self, places: list[int]) -> None:
        builder = self.builder
        kind = ir.ArrayType(SHORT, len(places))
        name = builder.module.get_unique_name("tape")
        steps = cgutils.add_global_variable(builder.module, kind, name)
        steps.initializer = ir.Constant(kind, places)
        steps.global_constant, steps.linkage = True, "internal"
        with cgutils.for_range(builder, ir.Constant(LONG, len(places) // 4)) as loop:
            first = builder.mul(loop.index, ir.Constant(LONG, 4))
            d, a, b, c = (
                builder.load(
                    builder.gep(
                        steps, [ir.Constant(LONG, 0), builder.add(first, ir.Constant(LONG, k))]
                    )
                )
                for k in range(4)
            )
            a, b, c = (builder.load(self._pointer(place)) for place in (a, b, c))
            product = builder.fmul(a, b, flags=("contract",))
            builder.store(builder.fadd(product, c, flags=("contract",)), self._pointer(d))

    def _pointer(self, place: Any) -> Any:
        return self.builder.gep(self.memory, [ir.Constant(SHORT, 0), place])


class Array:
    """An array in a formula that is noted: read at once, written once the tape has been played."""

    def __init__(self, tape: Tape, array: Any) -> None:
        self.tape, self.array = tape, array

    def __getitem__(self, k: int) -> Note:
        return self.tape.given(self.array[k])

    def __setitem__(self, k: int, note: Any) -> None:
        def use(lanes: list[Any]) -> None:
            self.array[k] = note.of(lanes[0]) if isinstance(note, Total) else lanes[0]

        self.tape.keep([note.note if isinstance(note, Total) else note], use)


class Total:
    """The sum over lanes of a note, to be written."""

    def __init__(self, note: Note, of: Callable[[Any], Any]) -> None:
        self.note, self.of = note, of
