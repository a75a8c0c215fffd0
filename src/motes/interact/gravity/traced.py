"""Straight-line machine code from a formula in Python.

A formula reads and writes arrays at places that Python knows, in loops over lists of terms. Traced,
it runs once, with values of LLVM for numbers, and what it did becomes the code of one operation
without loops, whose values stay in registers. Called on NumPy arrays, it does the same slowly.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from motes.interact.gravity import lanes as simd
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.tape import Array, Note, Tape


def traced(formula: Callable[..., None], looped: bool = False) -> Callable[..., None]:
    """An operation for kernels, from a formula of arrays and numbers; `looped`: played from a tape.

    A two-dimensional array is seen as rows of LANES numbers, `rows[k]`, a one-dimensional one as
    numbers. Both may be assigned to. With lanes, a number is that number in each lane.
    """
    if numba.config.DISABLE_JIT:
        # As in machine code, what overflows or is 0 / 0 is no fault: such cells are not far.
        return np.errstate(divide="ignore", invalid="ignore", over="ignore")(formula)

    def operation(typing: Any, *arguments: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            given = [_wire(context, builder, *pair) for pair in zip(sig.args, args, strict=True)]
            if looped:
                kinds = [a.element for a in given if isinstance(a, _Rows)]
                tape = Tape(builder, kinds[0], Wire)
                formula(*(_noted(tape, value) for value in given))
                tape.play()
            else:
                formula(*given)
            return context.get_dummy_value()

        return types.void(*arguments), generate

    given = inspect.signature(formula).parameters.values()
    first = inspect.Parameter("typing", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    operation.__signature__ = inspect.Signature([first, *given])  # type: ignore[attr-defined]
    operation.__name__ = formula.__name__
    return intrinsic(operation)  # type: ignore[no-any-return]


FLAGS = ("contract",)
"""Multiply-adds may be fused; the order of sums stands, as the compiler knows no better one."""


PART = 4
"""Numbers that a processor exchanges between registers in one step: 128 bits of single ones."""


class Wire:
    """Lanes, or a number, in a formula that is traced."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _with(self, other: Any, operation: Callable[..., Any]) -> Wire:
        a, b = self.value, other.value if isinstance(other, Wire) else other
        if not isinstance(other, Wire):
            wide = isinstance(a.type, ir.VectorType)
            b = simd.constant(a.type.element, b) if wide else ir.Constant(a.type, b)
        elif a.type != b.type:
            a, b = (
                v if isinstance(v.type, ir.VectorType) else simd.splat(self.builder, v)
                for v in (a, b)
            )
        return Wire(self.builder, operation(a, b, flags=FLAGS))

    def __add__(self, other: Any) -> Wire:
        return self._with(other, self.builder.fadd)

    def __sub__(self, other: Any) -> Wire:
        return self._with(other, self.builder.fsub)

    def __mul__(self, other: Any) -> Wire:
        return self._with(other, self.builder.fmul)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Wire:
        return self._with(other, self.builder.fdiv)

    def __neg__(self) -> Wire:
        return self * -1.0


class _Array:
    """An array in a formula: where it is, and its strides [elements]."""

    def __init__(self, context: Any, builder: Any, kind: Any, value: Any) -> None:
        array = context.make_array(kind)(context, builder, value)
        self.builder, self.data = builder, array.data
        self.element = context.get_value_type(kind.dtype)
        self.align = context.get_abi_sizeof(self.element)
        self.width = builder.extract_value(array.shape, 1) if kind.ndim == 2 else None

    def pointer(self, place: Any, wide: bool) -> Any:
        found = self.builder.gep(self.data, [place])
        if not wide:
            return found
        return self.builder.bitcast(found, ir.VectorType(self.element, LANES).as_pointer())

    def lanes(self, place: Any) -> Wire:
        return Wire(self.builder, self.builder.load(self.pointer(place, True), align=self.align))

    def part(self, place: Any) -> Any:
        pointer = self.builder.bitcast(
            self.builder.gep(self.data, [place]), ir.VectorType(self.element, PART).as_pointer()
        )
        return self.builder.load(pointer, align=self.align)

    def number(self, place: Any) -> Any:
        return self.builder.load(self.pointer(place, False))


class _Rows(_Array):
    def _first(self, row: Any) -> Any:
        return self.builder.mul(_index(row), _index(LANES))

    def __getitem__(self, row: int) -> Wire:
        return self.lanes(self._first(row))

    def __setitem__(self, row: int, lanes: Wire) -> None:
        pointer = self.pointer(self._first(row), True)
        self.builder.store(lanes.value, pointer, align=self.align)


class _Terms(_Array):
    def __getitem__(self, k: int) -> Wire:
        return Wire(self.builder, self.number(_index(k)))

    def __setitem__(self, k: int, number: Wire) -> None:
        self.builder.store(number.value, self.pointer(_index(k), False))


def _wire(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    if isinstance(kind, types.Array):
        return (_Rows if kind.ndim == 2 else _Terms)(context, builder, kind, value)
    if isinstance(kind, types.Integer):
        return builder.sext(value, ir.IntType(64)) if value.type.width < 64 else value
    return Wire(builder, value)


def _index(k: Any) -> Any:
    """A whole number as LLVM's; one of its values stays what it is."""
    return ir.Constant(ir.IntType(64), k) if isinstance(k, int) else k


def _noted(tape: Tape, value: Any) -> Any:
    if isinstance(value, Wire):
        return tape.given(lambda: value)
    return Array(tape, value) if isinstance(value, _Array) else value


def inverse_root(lanes: Any) -> Any:
    """1 / root of each lane."""
    if isinstance(lanes, Note):
        root = inverse_root(lanes.straight())
        return lanes.tape.given(lambda: root)
    if not isinstance(lanes, Wire):
        return lanes.dtype.type(1) / np.sqrt(lanes)
    one = simd.constant(lanes.value.type.element, 1.0)
    root = simd.square_root(lanes.builder, lanes.value)
    return Wire(lanes.builder, lanes.builder.fdiv(one, root))


def ones(like: Any) -> Any:
    """1 in each lane."""
    if isinstance(like, Note):
        return like.tape.note(1.0)
    if not isinstance(like, Wire):
        return np.ones_like(like)
    return Wire(like.builder, simd.constant(like.value.type.element, 1.0))


def rows(array: Any, count: int) -> list[Any]:
    """The first `count` rows of an array, or its numbers."""
    return array.rows(count) if isinstance(array, Array) else [array[k] for k in range(count)]


def write(array: Any, values: list[Any]) -> None:
    """Write lanes to the first rows of an array."""
    _write(array, values, lambda lanes: lanes)


def write_totals(array: Any, values: list[Any]) -> None:
    """Write the sums over lanes to the first numbers of an array."""
    _write(array, values, total)


def _write(array: Any, values: list[Any], change: Callable[[Any], Any]) -> None:
    if isinstance(array, Array):
        array.write(values, change)
    else:
        for k, value in enumerate(values):
            array[k] = change(value)


def all_positive(*values: Any) -> Any:
    """1 in each lane where all values are above 0, and 0 where one is not, or not a number."""
    if not isinstance(values[0], Wire):
        return np.logical_and.reduce([v > 0 for v in values]).astype(values[0].dtype)
    builder, element = values[0].builder, values[0].value.type.element
    zero = simd.constant(element, 0.0)
    found = None
    for value in values:
        one = builder.fcmp_ordered(">", value.value, zero)
        found = one if found is None else builder.and_(found, one)
    return Wire(builder, builder.select(found, simd.constant(element, 1.0), zero))


def total(lanes: Any) -> Any:
    """Sum over the lanes, a number."""
    if not isinstance(lanes, Wire):
        return lanes.sum()
    return Wire(lanes.builder, simd.added(lanes.builder, lanes.value))


def gathered(table: Any, chosen: Any, count: int) -> Sequence[Any]:
    """The first `count` columns of a table, lane k from row chosen[k]; its width fills lanes."""
    if isinstance(table, Array):
        return table.gathered(chosen, count, PART, gathering)
    if not isinstance(table, _Array):
        return [table[chosen[:LANES], column].copy() for column in range(count)]
    part = gathering(table, chosen)
    return [column for first in range(0, count, PART) for column in part(first)][:count]


def gathering(table: Any, chosen: Any) -> Callable[[Any], list[Wire]]:
    """Function that gathers PART columns of a table, from a given one on."""
    builder, long = table.builder, ir.IntType(64)
    rows = [
        builder.mul(builder.sext(chosen.number(_index(lane)), long), table.width)
        for lane in range(LANES)
    ]

    def columns(first: Any) -> list[Wire]:
        parts = [table.part(builder.add(row, _index(first))) for row in rows]
        # Parts k, k + 4, k + 8 ... end to end; then columns, in each part apart from the others.
        a, b, c, d = (simd.joined(builder, parts[k::PART]) for k in range(PART))
        low, high = (0, LANES, 1, LANES + 1), (2, LANES + 2, 3, LANES + 3)
        ab, ab_, cd, cd_ = (
            _by_parts(builder, *pair, places) for pair in ((a, b), (c, d)) for places in (low, high)
        )
        left, right = (0, 1, LANES, LANES + 1), (2, 3, LANES + 2, LANES + 3)
        return [
            Wire(builder, _by_parts(builder, *pair, places))
            for pair in ((ab, cd), (ab_, cd_))
            for places in (left, right)
        ]

    return columns


def _by_parts(builder: Any, a: Any, b: Any, places: tuple[int, ...]) -> Any:
    """The same shuffle in each part of two vectors, which a processor does in one step."""
    return simd.shuffle(builder, a, b, [k + p for k in range(0, LANES, PART) for p in places])


def scattered(columns: Sequence[Any], table: Any, first: Any) -> None:
    """Write lane k of all columns to row `first` + k of a table, whose width fills lanes."""
    if isinstance(table, Array):
        table.scattered(columns, lambda array, some, begin: scatter(some, array, first, begin))
        return
    if not isinstance(table, _Array):
        for column, values in enumerate(columns):
            table[first : first + LANES, column] = values
        return
    whole = [*columns, *[columns[-1]] * (-len(columns) % LANES)]
    for begin in range(0, len(whole), LANES):
        scatter(whole[begin : begin + LANES], table, first, begin)


def scatter(columns: Sequence[Any], table: Any, first: Any, begin: Any) -> None:
    """Write LANES columns to a table, from column `begin` on."""
    builder = table.builder
    for lane, row in enumerate(_transposed(builder, [column.value for column in columns])):
        place = builder.mul(builder.add(first, _index(lane)), table.width)
        pointer = table.pointer(builder.add(place, _index(begin)), True)
        builder.store(row, pointer, align=table.align)


def _transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """A square of LANES vectors, in log2(LANES) rounds that interleave the halves."""
    half = LANES // 2
    low = [v for k in range(half) for v in (k, k + LANES)]
    high = [v + half for v in low]
    for _ in range(LANES.bit_length() - 1):
        rows = [
            simd.shuffle(builder, rows[k], rows[k + half], places)
            for k in range(half)
            for places in (low, high)
        ]
    return rows
