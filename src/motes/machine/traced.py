"""Straight-line machine code from a formula in Python.

A formula reads and writes arrays at places that Python knows, in loops over lists of terms. Traced,
it runs once, with registers for numbers, and what it did becomes the code of one operation, without
loops but those that it asks for with `repeated`. Called on NumPy arrays, it does the same slowly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from motes.machine.block import literal
from motes.machine.kinds import INT, INT32, Number, Unsupported
from motes.machine.module import ROLLED
from motes.machine.target import widest
from motes.machine.values import Group, Known, Scalar, Value, View, Written

LANES = widest()
"""Numbers that travel together, but in operations that ask for another number of lanes."""

FLAGS = "contract"
"""Multiply-adds may be fused; the order of sums stands, as the compiler knows no better one."""

FITTING = {8: 9, 16: 20}
"""Registers' worth of sums that fit beside what they are multiplied by, by the lanes of a register:
there are 16 of eight lanes, 32 of sixteen."""

MANY = 12
"""Rounds from which a loop is worth one: fewer are written one after the other."""

PART = 4
"""Numbers that a processor exchanges between registers in one step: 128 bits of single ones."""


class Traced(Written):
    """An operation for kernels, from a formula of arrays and numbers.

    A two-dimensional array is seen as rows of `lanes` numbers, `rows[k]`, a one-dimensional one as
    numbers. Both may be assigned to. With lanes, a number is that number in each lane. What the
    formula returns, lanes or a tuple of them, the operation returns.
    """

    def __init__(self, formula: Callable[..., Any], lanes: int) -> None:
        self.formula, self.lanes = formula, lanes
        self.__name__ = formula.__name__

    def __call__(self, *arguments: Any) -> Any:
        """Run on NumPy arrays. What overflows or is 0 / 0 is no fault, as in machine code."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return self.formula(*arguments)

    def write(self, writer: Any, values: Sequence[Value]) -> Value:
        """The operation's code, for arguments in registers."""
        given = [_wire(writer, value, self.lanes) for value in values]
        found = self.formula(*given)
        if isinstance(found, tuple):
            return Group(tuple(wire.value for wire in found))
        return Known(None) if found is None else found.value


def traced(formula: Callable[..., Any], lanes: int = LANES) -> Callable[..., Any]:
    """A formula as an operation."""
    return Traced(formula, lanes)


class Wire:
    """Lanes, or a number, in a formula that is traced."""

    def __init__(self, writer: Any, value: Scalar) -> None:
        self.writer, self.value = writer, value

    def _with(self, other: Any, step: str) -> Wire:
        a = self.value
        b = other.value if isinstance(other, Wire) else literal(other, a.type)
        kind = a.type.over(max(a.type.lanes, b.type.lanes))
        a, b = (self.writer.cast(v, kind) for v in (a, b))
        text = f"{step} {FLAGS} {kind.llvm} {a.text}, {b.text}"
        return Wire(self.writer, Scalar(kind, self.writer.do(text)))

    def __add__(self, other: Any) -> Wire:
        return self._with(other, "fadd")

    def __sub__(self, other: Any) -> Wire:
        return self._with(other, "fsub")

    def __mul__(self, other: Any) -> Wire:
        return self._with(other, "fmul")

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Wire:
        return self._with(other, "fdiv")

    def __neg__(self) -> Wire:
        return self * -1.0


class _Array:
    """An array in a formula."""

    def __init__(self, writer: Any, view: View, across: int) -> None:
        if not view.type.packed:
            raise Unsupported("formulas take packed arrays only")
        self.writer, self.view, self.item, self.across = writer, view, view.type.item, across
        self.width = view.shape[1] if view.type.axes == 2 else ""

    def lanes(self, place: str, kind: Number) -> Scalar:
        """Numbers from a place on."""
        return Scalar(kind, self.writer.do(f"load {self._memory(place, kind)}"))

    def put(self, place: str, value: Scalar) -> None:
        """Write numbers from a place on."""
        where = self._memory(place, value.type, f" {value.text}")
        self.writer.line(f"store {where}")

    def _memory(self, place: str, kind: Number, text: str = "") -> str:
        step = f"getelementptr inbounds {self.item.stored}, ptr {self.view.address}, i64 {place}"
        mark = self.writer.kind_of_memory(self.item)
        at = self.writer.do(step)
        return f"{kind.llvm}{text}, ptr {at}, align {self.item.bytes}{mark}"

    def row(self, number: str) -> str:
        """Place of the first number in a row."""
        return product(self.writer, number, self.width)


class _Rows(_Array):
    """An array of two axes: rows of `across` numbers."""

    def _first(self, row: Any) -> str:
        if isinstance(row, int):
            return str(row * self.across)
        return product(self.writer, row, str(self.across))

    def __getitem__(self, row: Any) -> Wire:
        return Wire(self.writer, self.lanes(self._first(row), self.item.over(self.across)))

    def __setitem__(self, row: Any, wire: Wire) -> None:
        self.put(self._first(row), self.writer.cast(wire.value, self.item.over(self.across)))


class _Terms(_Array):
    """An array of one axis: numbers."""

    def __getitem__(self, k: Any) -> Wire:
        return Wire(self.writer, self.lanes(str(k), self.item))

    def __setitem__(self, k: Any, number: Wire) -> None:
        self.put(str(k), number.value)


def product(writer: Any, a: str, b: str) -> str:
    """Of two integers of 64 bits."""
    return str(writer.do(f"mul nsw i64 {a}, {b}"))


def place(writer: Any, a: str, b: Any) -> str:
    """Sum of two integers of 64 bits."""
    return str(writer.do(f"add nsw i64 {a}, {b}"))


def _wire(writer: Any, value: Value, lanes: int) -> Any:
    if isinstance(value, View):
        return (_Rows if value.type.axes == 2 else _Terms)(writer, value, lanes)
    if not isinstance(value, Scalar):
        raise Unsupported("formulas take arrays and numbers")
    return writer.cast(value, INT).text if value.type.whole else Wire(writer, value)


def inverse_root(lanes: Any) -> Any:
    """1 / root of each lane."""
    if not isinstance(lanes, Wire):
        return lanes.dtype.type(1) / np.sqrt(lanes)
    root = Wire(lanes.writer, lanes.writer.intrinsic("sqrt", lanes.value))
    return ones(lanes) / root


def repeated(
    array: Any, first: int, last: int, values: list[Any], body: Callable[..., list[Any]]
) -> list[Any]:
    """The last of `values = body(k, values)`, k = first ... last - 1: if they are many, in a loop.

    `array` is any that the formula has been given.
    """
    if not isinstance(array, _Array) or last - first < MANY:
        for k in range(first, last):
            forget(array)
            values = body(k, values)
        return values
    writer = array.writer

    def step(index: Scalar, inner: list[Scalar]) -> list[Scalar]:
        return [wire.value for wire in body(index.text, [Wire(writer, v) for v in inner])]

    start = [wire.value for wire in values]
    found = writer.carried(str(first), str(last), start, step, f", !llvm.loop {ROLLED}")
    return [Wire(writer, value) for value in found]


def held() -> int:
    """How many lanes, each a register full, can be summed at once."""
    return FITTING[widest()]


def shifted(array: Any, row: Any, shifts: Sequence[int]) -> list[Any]:
    """Rows of an array, `shifts` after one which need not be known."""
    if isinstance(row, str):
        return [array[place(array.writer, row, shift)] for shift in shifts]
    return [array[row + shift] for shift in shifts]


def whole(numbers: Any, k: Any) -> Any:
    """An integer out of an array of 32 bits."""
    if not isinstance(numbers, _Array):
        return int(numbers[k])
    return numbers.writer.cast(numbers.lanes(str(k), INT32), INT).text


def like(lanes: Any, other: Any) -> Any:
    """The same in the precision of others."""
    if not isinstance(lanes, Wire):
        return np.asarray(lanes, other.dtype)
    return Wire(lanes.writer, lanes.writer.cast(lanes.value, other.value.type))


def zeros(like: Any) -> Any:
    """0 in each lane."""
    if not isinstance(like, Wire):
        return np.zeros_like(like)
    return Wire(like.writer, literal(0.0, like.value.type))


def forget(array: Any) -> None:
    """Keep machine code from holding in registers, or beside them, what arrays hold anyway."""
    if isinstance(array, _Array):
        array.writer.line('fence syncscope("singlethread") acq_rel')


def ones(like: Any) -> Any:
    """1 in each lane."""
    if not isinstance(like, Wire):
        return np.ones_like(like)
    return Wire(like.writer, literal(1.0, like.value.type))


def rows(array: Any, count: int) -> list[Any]:
    """The first `count` rows of an array, or its numbers."""
    return [array[k] for k in range(count)]


def write(array: Any, values: list[Any]) -> None:
    """Write lanes to the first rows of an array."""
    for k, value in enumerate(values):
        array[k] = value


def write_totals(array: Any, values: list[Any]) -> None:
    """Write the sums over lanes to the first numbers of an array."""
    write(array, [total(value) for value in values])


def total(lanes: Any) -> Any:
    """Sum over the lanes, a number."""
    if not isinstance(lanes, Wire):
        return lanes.sum()
    return Wire(lanes.writer, lanes.writer.total(lanes.value))


def gathered(table: Any, chosen: Any, count: int, lanes: int = LANES) -> Sequence[Any]:
    """The first `count` columns of a table, lane k from row chosen[k]; its width fills PARTs."""
    if not isinstance(table, _Array):
        return [table[chosen[:lanes], column].copy() for column in range(count)]
    part = gathering(table, chosen, lanes)
    return [column for first in range(0, count, PART) for column in part(first)][:count]


def gathering(table: Any, chosen: Any, lanes: int) -> Callable[[int], list[Wire]]:
    """Function that gathers PART columns of a table, from a given one on."""
    writer, small = table.writer, table.item.over(PART)
    starts = []
    for lane in range(lanes):
        number = writer.cast(chosen.lanes(str(lane), INT32), INT)
        starts.append(table.row(number.text))

    def columns(first: int) -> list[Wire]:
        parts = [table.lanes(place(writer, start, first), small) for start in starts]
        # Parts k, k + 4, k + 8 ... end to end; then columns, in each part apart from the others.
        a, b, c, d = (_joined(writer, parts[k::PART]) for k in range(PART))
        low, high = (0, lanes, 1, lanes + 1), (2, lanes + 2, 3, lanes + 3)
        ab, ab_, cd, cd_ = (
            _by_parts(writer, *pair, places) for pair in ((a, b), (c, d)) for places in (low, high)
        )
        left, right = (0, 1, lanes, lanes + 1), (2, 3, lanes + 2, lanes + 3)
        return [
            Wire(writer, _by_parts(writer, *pair, places))
            for pair in ((ab, cd), (ab_, cd_))
            for places in (left, right)
        ]

    return columns


def _shuffle(writer: Any, a: Scalar, b: Scalar, places: list[int]) -> Scalar:
    text = writer.shuffled(a.type.llvm, (a.text, b.text), places)
    return Scalar(a.type.over(len(places)), writer.do(text))


def _joined(writer: Any, parts: list[Scalar]) -> Scalar:
    """Vectors end to end."""
    while len(parts) > 1:
        width = parts[0].type.lanes
        pairs = zip(parts[::2], parts[1::2], strict=True)
        parts = [_shuffle(writer, a, b, list(range(2 * width))) for a, b in pairs]
    return parts[0]


def _by_parts(writer: Any, a: Scalar, b: Scalar, places: tuple[int, ...]) -> Scalar:
    """The same shuffle in each part of two vectors, which a processor does in one step."""
    return _shuffle(writer, a, b, [k + p for k in range(0, a.type.lanes, PART) for p in places])


def scattered(columns: Sequence[Any], table: Any, first: Any) -> None:
    """Write lane k of all columns to row `first` + k of a table, whose width fills lanes."""
    if not isinstance(table, _Array):
        for column, values in enumerate(columns):
            table[first : first + len(values), column] = values
        return
    lanes = columns[0].value.type.lanes
    whole = [*columns, *[columns[-1]] * (-len(columns) % lanes)]
    for begin in range(0, len(whole), lanes):
        scatter(whole[begin : begin + lanes], table, first, begin)


def scatter(columns: Sequence[Any], table: Any, first: str, begin: int) -> None:
    """Write as many columns as lanes to a table, from column `begin` on."""
    writer = table.writer
    for lane, row in enumerate(_transposed(writer, [column.value for column in columns])):
        start = table.row(place(writer, first, lane))
        table.put(place(writer, start, begin), row)


def _transposed(writer: Any, rows: list[Scalar]) -> list[Scalar]:
    """A square of vectors, in log2(lanes) rounds that interleave the halves."""
    lanes = len(rows)
    half = lanes // 2
    low = [v for k in range(half) for v in (k, k + lanes)]
    high = [v + half for v in low]
    for _ in range(lanes.bit_length() - 1):
        rows = [
            _shuffle(writer, rows[k], rows[k + half], places)
            for k in range(half)
            for places in (low, high)
        ]
    return rows
