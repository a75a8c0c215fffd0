"""Calls: Python's and NumPy's functions that kernels may use, and other kernels."""

from __future__ import annotations

import hashlib
import math
import types
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from motes.machine.block import literal
from motes.machine.kinds import (
    BOOL,
    DOUBLE,
    INT,
    INT32,
    NUMBERS,
    Array,
    Number,
    Unsupported,
    of_dtype,
)
from motes.machine.lanes import (
    bits,
    choose,
    fetch,
    largest,
    lowest,
    put,
    put_some,
    rough_inverse_root,
    settled,
    spread_over,
    streams,
    take,
    total,
)
from motes.machine.many import Many
from motes.machine.shuffles import (
    SEEKING_NEEDS,
    near_slots,
    order_table,
    seeking,
    taken_apart,
    taking,
)
from motes.machine.values import Group, Known, Scalar, Value, View, Written, type_of

ROOM = 1 << 14
"""Elements of an array that is kept on the stack; larger ones, or of a size that is not known while
compiling, come from the heap."""


def plain_function(thing: Any) -> types.FunctionType | None:
    """The Python function behind a kernel, a compiled function or a function; else None."""
    function = getattr(thing, "py_func", thing)
    return function if isinstance(function, types.FunctionType) else None


class Calls(Many):
    """Calls by what is called."""

    def constant(self, thing: Any) -> Value:
        """The value of a Python object that a function finds in its module or closure."""
        if isinstance(thing, bool | np.bool_):
            return literal(bool(thing), BOOL)
        if isinstance(thing, np.generic):
            return literal(thing.item(), of_dtype(thing.dtype))
        if isinstance(thing, int):
            return literal(thing, INT, bare=True)
        if isinstance(thing, float):
            return literal(thing, DOUBLE, bare=True)
        if isinstance(thing, tuple):
            items = tuple(self.constant(t) for t in thing)
            return Group(items, tuple(getattr(thing, "_fields", ())))
        if isinstance(thing, np.ndarray):
            return self._table(thing)
        return Known(thing)

    def _table(self, array: np.ndarray[Any, Any]) -> Value:
        """An array as it is while compiling, part of the machine code; it is only read."""
        item = of_dtype(array.dtype)
        if array.size > ROOM:
            raise Unsupported(f"an array of more than {ROOM} numbers; pass it as an argument")
        whole = item.kind == "b"
        numbers = [str(int(x)) if whole else literal(x, item).text for x in array.ravel().tolist()]
        content = ", ".join(f"{item.stored} {number}" for number in numbers)
        kind = f"[{array.size} x {item.stored}]"
        name = f"@table_{hashlib.sha256(f'{kind}{content}'.encode()).hexdigest()[:24]}"
        filled = f"[{content}]" if array.size else "zeroinitializer"
        self.declare(f"{name} = internal global {kind} {filled}, align 64")
        extents = tuple(map(str, array.shape))
        return View(Array(item, array.ndim, True), name, extents)

    def call(self, thing: Any, arguments: Sequence[Value]) -> Value:
        """The value of a call of something known."""
        try:
            handler = BUILT_IN.get(thing)
        except TypeError:
            handler = None
        if handler is not None:
            return handler(self, *arguments)
        if isinstance(thing, type) and issubclass(thing, np.generic):
            return self.cast(self._number(*arguments), of_dtype(np.dtype(thing)))
        if isinstance(thing, type) and issubclass(thing, tuple) and hasattr(thing, "_fields"):
            if len(arguments) != len(thing._fields):
                raise Unsupported(f"{thing.__name__} takes {len(thing._fields)} values")
            return Group(tuple(arguments), thing._fields)
        if isinstance(thing, np.ufunc | types.BuiltinFunctionType) and thing in FORMULAS:
            return self.formula(FORMULAS[thing], arguments)
        if isinstance(thing, Written):
            return thing.write(self, arguments)
        function = plain_function(thing)
        if function is None:
            raise Unsupported(f"{getattr(thing, '__name__', thing)!r} cannot be called in a kernel")
        return self.call_function(thing, function, arguments)

    def call_function(
        self, thing: Any, function: types.FunctionType, arguments: Sequence[Value]
    ) -> Value:
        """The value of a call of another kernel."""
        raise NotImplementedError

    def formula(self, name: str, arguments: Sequence[Value]) -> Value:
        """An elementary function, by the project's own formula for the arguments' precision."""
        from motes.kernel import ELEMENTARY

        numbers = [self._real(a) for a in arguments]
        precision = "single" if all(n.type.bits == 32 for n in numbers) else "double"
        kind = NUMBERS["float32" if precision == "single" else "float64"]
        kernel = ELEMENTARY[name].compiled(precision)
        function = plain_function(kernel)
        assert function is not None
        return self.call_function(kernel, function, [self.cast(n, kind) for n in numbers])

    def _number(self, *arguments: Value) -> Scalar:
        if len(arguments) != 1 or not isinstance(arguments[0], Scalar):
            raise Unsupported("a number is made of one number")
        return arguments[0]

    def _real(self, value: Value) -> Scalar:
        number = self._number(value)
        return number if number.type.kind == "f" else self.cast(number, DOUBLE)

    def smallest(self, *arguments: Value) -> Value:
        """min."""
        return self._extreme("Lt", arguments)

    def largest(self, *arguments: Value) -> Value:
        """max."""
        return self._extreme("Gt", arguments)

    def _extreme(self, better: str, arguments: Sequence[Value]) -> Value:
        if len(arguments) == 1 and isinstance(arguments[0], Group):
            arguments = arguments[0].items
        best = self._number(arguments[0])
        for argument in arguments[1:]:
            other = self._number(argument)
            kind = self.together(best, other)
            if best.type == other.type:
                kind = best.type
            bare = best.bare and other.bare
            if best.literal is not None and other.literal is not None:
                wins = other.literal < best.literal if better == "Lt" else None
                wins = other.literal > best.literal if wins is None else wins
                best = literal(other.literal if wins else best.literal, kind, bare)
                continue
            a, b = self.cast(best, kind), self.cast(other, kind)
            picked = self.chosen(self.compare(better, b, a), b, a)
            assert isinstance(picked, Scalar)
            best = picked
        return best

    def magnitude(self, value: Value) -> Value:
        """abs."""
        number = self._number(value)
        if number.literal is not None:
            return literal(abs(number.literal), number.type, number.bare)
        if number.type.kind == "f":
            return self.intrinsic("fabs", number)
        if number.type.kind == "u":
            return number
        return self.intrinsic("abs", self.cast(number, INT))

    def whole_number(self, value: Value) -> Value:
        """int: the integer towards 0."""
        number = self._number(value)
        unsigned = number.type.kind == "u"
        return self.cast(number, NUMBERS["uint64"] if unsigned else INT)

    def rounded_down(self, value: Value) -> Value:
        """math.floor: an integer."""
        return self.cast(self.intrinsic("floor", self._real(value)), INT)

    def finite(self, value: Value) -> Value:
        """numpy.isfinite."""
        size = self.intrinsic("fabs", self._real(value))
        return self.compare("Lt", size, literal(math.inf, size.type))

    def not_a_number(self, value: Value) -> Value:
        """numpy.isnan."""
        number = self._real(value)
        test = f"fcmp uno {number.type.llvm} {number.text}, {number.text}"
        return Scalar(BOOL.over(number.type.lanes), self.do(test))

    def length(self, value: Value) -> Value:
        """len."""
        if isinstance(value, View):
            return Scalar(INT, value.shape[0])
        if isinstance(value, Group):
            return literal(len(value.items), INT, bare=True)
        raise Unsupported("len of a number")

    def numbered(self, value: Value) -> Value:
        """enumerate, of a tuple."""
        if not isinstance(value, Group):
            raise Unsupported("enumerate of anything but a tuple")
        pairs = enumerate(value.items)
        return Group(tuple(Group((literal(k, INT, bare=True), item)) for k, item in pairs))

    def bits_as(self, value: Scalar, kind: Number) -> Scalar:
        """`value.view(type)`: the same bits as another type."""
        kind = kind.over(value.type.lanes)
        if value.type.bits != kind.bits:
            raise Unsupported(f"{value.type} and {kind} differ in size")
        if value.type.llvm == kind.llvm:
            return Scalar(kind, value.text)
        return Scalar(kind, self.do(f"bitcast {value.type.llvm} {value.text} to {kind.llvm}"))

    def empty(self, shape: Value, kind: Value = Known(np.float64)) -> Value:  # noqa: B008
        """numpy.empty: room that the call has for itself; its numbers are not set."""
        item = of_dtype(np.dtype(_thing(kind)))
        extents = shape.items if isinstance(shape, Group) else (shape,)
        sizes = [self.cast(self._number(e), INT) for e in extents]
        packed = Array(item, len(sizes), True)
        texts = tuple(size.text for size in sizes)
        known = [size.literal for size in sizes]
        if None not in known and (total := math.prod(known)) <= ROOM:
            return View(packed, self.room(item, max(total, 1)), texts)
        bytes = str(item.bytes)
        for text in texts:
            bytes = self.do(f"mul nsw i64 {bytes}, {text}")
        return View(packed, self.heap(bytes), texts)

    def reshaped(self, array: View, extents: Sequence[Value]) -> View:
        """`array.reshape`, `array.ravel()` of a packed array: the same numbers in another shape."""
        if not array.type.packed:
            raise Unsupported("only an array whose numbers follow each other can be reshaped")
        if len(extents) == 1 and isinstance(extents[0], Group):
            extents = extents[0].items
        sizes = [self.cast(self._number(e), INT) for e in extents]
        texts = [size.text for size in sizes]
        for place, size in enumerate(sizes):
            if size.literal == -1:
                others = self.product([*texts[:place], *texts[place + 1 :]])
                texts[place] = self.do(f"sdiv i64 {self.product(array.shape)}, {others}")
        return View(Array(array.type.item, len(texts), True), array.address, tuple(texts))

    def product(self, extents: Sequence[str]) -> str:
        """Of integers in registers."""
        result = "1"
        for place, extent in enumerate(extents):
            result = self.do(f"mul nsw i64 {result}, {extent}") if place else extent
        return result

    def zeros(self, shape: Value, kind: Value = Known(np.float64)) -> Value:  # noqa: B008
        """numpy.zeros."""
        array = self.empty(shape, kind)
        assert isinstance(array, View)
        self.fill(array, literal(0, array.type.item))
        return array

    def heap(self, bytes: str) -> str:
        """Address of memory that is given back when the function returns."""
        raise NotImplementedError

    def written(self, name: str, text: str) -> None:
        """See to it that the module holds a function whose text is known."""
        raise NotImplementedError

    def taken_apart(self, records: Value, slots: Value, *columns: Value) -> Value:
        """`lanes.taken_apart`."""
        views = self._packed(records, slots, *columns)
        item = views[0].type.item
        if views[0].type.axes != 2 or item.kind != "f" or views[1].type.item.bits != 32:
            raise Unsupported("records of real numbers are taken apart, by numbers of 32 bits")
        name = f"taken_apart.{item.llvm}"
        self.written(name, taking(item.llvm))
        x, y, z = (f"ptr {view.address}" for view in views[2:])
        given = f"ptr {views[0].address}, ptr {views[1].address}, i64 {views[1].shape[0]}"
        self.line(f"call void @{name}({given}, {x}, {y}, {z})")
        return Known(None)

    def near_slots(self, *given: Value) -> Value:
        """`lanes.near_slots`."""
        from motes.machine.target import moves_lanes

        if not moves_lanes():
            plain = plain_function(near_slots)
            assert plain is not None
            return self.call_function(near_slots, plain, given)
        views = self._packed(*given[5:])
        item = views[0].type.item
        numbers = [self.cast(self._number(value), item).text for value in given[:4]]
        me = self.cast(self._number(given[4]), INT32).text
        for declaration in SEEKING_NEEDS:
            self.declare(declaration)
        order_table(self)
        name = f"near_slots.{item.llvm}"
        self.written(name, seeking(item.llvm))
        passed = [f"{item.llvm} {number}" for number in numbers]
        passed += [f"i32 {me}", *(f"ptr {view.address}" for view in views[:4])]
        passed += [f"i64 {views[3].shape[0]}", f"ptr {views[4].address}"]
        return Scalar(INT, self.do(f"call i64 @{name}({', '.join(passed)})"))

    def _packed(self, *values: Value) -> list[View]:
        views = [value for value in values if isinstance(value, View) and value.type.packed]
        if len(views) != len(values):
            raise Unsupported("only packed arrays are taken here")
        return views


def _thing(value: Value) -> Any:
    if not isinstance(value, Known):
        raise Unsupported(f"{type_of(value)} where a type is needed")
    return value.thing


def _intrinsic(name: str) -> Callable[..., Value]:
    def call(self: Calls, value: Value) -> Value:
        return self.intrinsic(name, self._real(value))

    return call


BUILT_IN: dict[Any, Callable[..., Value]] = {
    min: Calls.smallest,
    max: Calls.largest,
    abs: Calls.magnitude,
    np.abs: Calls.magnitude,
    int: Calls.whole_number,
    float: lambda self, value: self.cast(self._number(value), DOUBLE),
    bool: lambda self, value: self.truth(value),
    len: Calls.length,
    math.floor: Calls.rounded_down,
    np.isfinite: Calls.finite,
    math.isfinite: Calls.finite,
    np.isnan: Calls.not_a_number,
    math.isnan: Calls.not_a_number,
    np.empty: Calls.empty,
    np.zeros: Calls.zeros,
    math.sqrt: _intrinsic("sqrt"),
    np.sqrt: _intrinsic("sqrt"),
    np.floor: _intrinsic("floor"),
    np.ceil: _intrinsic("ceil"),
    np.trunc: _intrinsic("trunc"),
    np.round: _intrinsic("roundeven"),
    np.rint: _intrinsic("roundeven"),
    enumerate: Calls.numbered,
    take: Calls.take,
    put: Calls.put,
    fetch: Calls.fetch,
    bits: Calls.bits,
    lowest: Calls.lowest,
    choose: Calls.choose,
    total: Calls.total,
    largest: Calls.largest_lane,
    rough_inverse_root: Calls.rough_inverse_root,
    put_some: Calls.put_some,
    spread_over: Calls.spread_over,
    streams: Calls.streams,
    settled: _intrinsic("arithmetic.fence"),
    math.fabs: _intrinsic("fabs"),
    taken_apart: Calls.taken_apart,
    near_slots: Calls.near_slots,
}
"""Handlers by the function itself."""

FORMULAS = {
    np.exp: "exp", np.log: "log", np.sin: "sin", np.cos: "cos", np.tanh: "tanh",
    np.arctan2: "atan2", np.power: "pow",
    math.exp: "exp", math.log: "log", math.sin: "sin", math.cos: "cos", math.tanh: "tanh",
    math.atan2: "atan2", math.pow: "pow",
}  # fmt: skip
"""NumPy's and Python's functions that the project has formulas for."""
