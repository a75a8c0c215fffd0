"""Arithmetic, comparisons, indices: expressions of numbers, tuples and arrays as LLVM's text."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

from motes.machine.block import Writer, literal
from motes.machine.types import BOOL, DOUBLE, INT, UINT, Array, LiteralNeeded, Number, Unsupported, arithmetic
from motes.machine.values import Group, Known, Scalar, Value, View, of_registers, registers

FOLDED: dict[str, Callable[[Any, Any], Any]] = {
    "Add": operator.add, "Sub": operator.sub, "Mult": operator.mul,
    "FloorDiv": operator.floordiv, "Mod": operator.mod, "Div": operator.truediv,
    "Pow": operator.pow, "LShift": operator.lshift, "RShift": operator.rshift,
    "BitAnd": operator.and_, "BitOr": operator.or_, "BitXor": operator.xor,
}  # fmt: skip
REAL = {"Add": "fadd", "Sub": "fsub", "Mult": "fmul", "Div": "fdiv"}
WHOLE = {"Add": "add", "Sub": "sub", "Mult": "mul"}
BITS = {"BitAnd": "and", "BitOr": "or", "BitXor": "xor"}
ORDER = {"Lt": "lt", "LtE": "le", "Gt": "gt", "GtE": "ge", "Eq": "eq", "NotEq": "ne"}
SWAPPED = {"Lt": "Gt", "LtE": "GtE", "Gt": "Lt", "GtE": "LtE", "Eq": "Eq", "NotEq": "NotEq"}

PRODUCTS = 16
"""Largest whole exponent that becomes products."""


class Arithmetic(Writer):
    """Operations on numbers."""

    def together(self, a: Scalar, b: Scalar) -> Number:
        """The type in which an operation on two numbers is done; bare literals take the other's."""
        for bare, other in ((a, b), (b, a)):
            if bare.bare and not other.bare and bare.literal is not None:
                if other.type.kind == "f":
                    return other.type
                if other.type.kind == "u" and bare.type == INT and bare.literal >= 0:
                    return UINT
        return arithmetic(a.type, b.type)

    def binary(self, name: str, a: Value, b: Value) -> Value:
        """The value of an operator, by its name in Python's syntax tree."""
        if isinstance(a, Group) and isinstance(b, Group) and name == "Add":
            return Group((*a.items, *b.items))
        if not isinstance(a, Scalar) or not isinstance(b, Scalar):
            raise Unsupported(f"operator {name} works on numbers only")
        if (known := self._folded(name, a, b)) is not None:
            return known
        if name == "Pow":
            return self.power(a, b)
        if name in BITS:
            both = a.type.kind == b.type.kind == "b"
            kind = BOOL if both else self.together(a, b)
            if not kind.whole:
                raise Unsupported("operators of bits work on integers only")
            return self._plain(BITS[name], kind, a, b)
        if name in ("LShift", "RShift"):
            kind = arithmetic(a.type, a.type)
            step = "shl" if name == "LShift" else "lshr" if kind.kind == "u" else "ashr"
            return self._plain(step, kind, a, b)
        kind = self.together(a, b)
        if name == "Div" and kind.whole:
            kind = DOUBLE
        if kind.kind == "f":
            if name in REAL:
                return self._plain(f"{REAL[name]} {self.flags}".strip(), kind, a, b)
            return self._floored_real(name, self.cast(a, kind), self.cast(b, kind))
        if name in WHOLE:
            return self._plain(WHOLE[name], kind, a, b)
        return self._floored(name, self.cast(a, kind), self.cast(b, kind))

    def _plain(self, step: str, kind: Number, a: Scalar, b: Scalar) -> Scalar:
        left, right = self.cast(a, kind).text, self.cast(b, kind).text
        return Scalar(kind, self.do(f"{step} {kind.llvm} {left}, {right}"))

    def _folded(self, name: str, a: Scalar, b: Scalar) -> Scalar | None:
        """The result where both numbers are known."""
        if a.literal is None or b.literal is None:
            return None
        kind = self.together(a, b)
        if name == "Div" and kind.whole:
            kind = DOUBLE
        try:
            left, right = literal(a.literal, kind).literal, literal(b.literal, kind).literal
            if name == "Pow" and kind.whole and right < 0:
                return None
            result = FOLDED[name](left, right)
        except (ArithmeticError, TypeError, ValueError):
            return None
        if isinstance(result, complex):
            return None
        if kind.kind == "b" and name not in BITS:
            kind = INT
        return literal(result, kind, a.bare and b.bare)

    def _floored(self, name: str, a: Scalar, b: Scalar) -> Scalar:
        """Quotient or remainder of integers, rounded down; 0 for a divisor 0."""
        kind = a.type
        known = b.literal
        if known is not None and known > 0 and known & (known - 1) == 0:
            if name == "Mod":
                return Scalar(kind, self.do(f"and {kind.llvm} {a.text}, {known - 1}"))
            step = "lshr" if kind.kind == "u" else "ashr"
            return Scalar(kind, self.do(f"{step} {kind.llvm} {a.text}, {known.bit_length() - 1}"))
        divisor, empty = b.text, ""
        if known is None:
            empty = self.do(f"icmp eq {kind.llvm} {b.text}, 0")
            divisor = self.do(f"select i1 {empty}, {kind.llvm} 1, {kind.llvm} {b.text}")
        sign = kind.kind if kind.kind == "u" else "s"
        rest = self.do(f"{sign}rem {kind.llvm} {a.text}, {divisor}")
        result = rest
        if name == "FloorDiv":
            result = self.do(f"{sign}div {kind.llvm} {a.text}, {divisor}")
        if sign == "s":
            odd = self.do(f"icmp ne {kind.llvm} {rest}, 0")
            mixed = self.do(f"xor {kind.llvm} {rest}, {divisor}")
            apart = self.do(f"icmp slt {kind.llvm} {mixed}, 0")
            wrong = self.do(f"and i1 {odd}, {apart}")
            step = f"add {kind.llvm} {result}, {'-1' if name == 'FloorDiv' else divisor}"
            right = self.do(step)
            result = self.do(f"select i1 {wrong}, {kind.llvm} {right}, {kind.llvm} {result}")
        if empty:
            result = self.do(f"select i1 {empty}, {kind.llvm} 0, {kind.llvm} {result}")
        return Scalar(kind, result)

    def _floored_real(self, name: str, a: Scalar, b: Scalar) -> Scalar:
        """Quotient rounded down, or the remainder that has the divisor's sign, a - b floor(a / b).

        For a remainder that is exact where the quotient is.
        """
        kind = a.type
        quotient = self.do(f"fdiv {kind.llvm} {a.text}, {b.text}")
        whole = self.intrinsic("floor", Scalar(kind, quotient))
        if name == "FloorDiv":
            return whole
        product = self.do(f"fmul {kind.llvm} {whole.text}, {b.text}")
        return Scalar(kind, self.do(f"fsub {kind.llvm} {a.text}, {product}"))

    def power(self, a: Scalar, b: Scalar) -> Scalar:
        """A power: products for small whole exponents."""
        if b.literal is not None and b.literal == int(b.literal) and abs(b.literal) <= PRODUCTS:
            kind = a.type if a.type.kind == "f" else INT
            result, square, rest = None, self.cast(a, kind), abs(int(b.literal))
            while rest:
                if rest & 1:
                    result = square if result is None else self.binary("Mult", result, square)
                rest >>= 1
                if rest:
                    square = self.binary("Mult", square, square)  # type: ignore[assignment]
            one = literal(1, kind)
            found = one if result is None else result
            return self.binary("Div", one, found) if b.literal < 0 else found  # type: ignore[return-value]
        raise Unsupported("a power needs a whole exponent; write pow of motes.kernel")

    def intrinsic(self, name: str, *values: Scalar) -> Scalar:
        """One of LLVM's own functions on numbers of one type."""
        kind = values[0].type
        arguments = ", ".join(f"{kind.llvm} {v.text}" for v in values)
        suffix = f"f{kind.bits}" if kind.kind == "f" else f"i{kind.bits}"
        function = f"@llvm.{name}.{suffix}"
        extra = ", i1 false" if name == "abs" else ""
        self.declare(
            f"declare {kind.llvm} {function}"
            f"({', '.join([kind.llvm] * len(values))}{', i1' if extra else ''})"
        )
        flags = self.flags if kind.kind == "f" else ""
        return Scalar(kind, self.do(f"call {flags}{kind.llvm} {function}({arguments}{extra})"))

    def declare(self, text: str) -> None:
        """Declare a function outside of the module."""
        raise NotImplementedError

    def negative(self, value: Scalar) -> Scalar:
        """-value."""
        if value.literal is not None:
            kind = INT if value.type.kind == "b" else value.type
            return literal(-value.literal, kind, value.bare)
        if value.type.kind == "f":
            text = f"fneg {self.flags}{value.type.llvm} {value.text}"
            return Scalar(value.type, self.do(text))
        kind = arithmetic(value.type, value.type)
        return Scalar(kind, self.do(f"sub {kind.llvm} 0, {self.cast(value, kind).text}"))

    def compare(self, name: str, a: Scalar, b: Scalar) -> Scalar:
        """A comparison, by its name in Python's syntax tree; false with NaN, except !=."""
        if a.literal is not None and b.literal is not None:
            known = {
                "Lt": operator.lt, "LtE": operator.le, "Gt": operator.gt, "GtE": operator.ge,
                "Eq": operator.eq, "NotEq": operator.ne,
            }[name](a.literal, b.literal)  # fmt: skip
            return literal(known, BOOL)
        test = ORDER[name]
        if not (a.type.whole and b.type.whole):
            kind = self.together(a, b)
            left, right = self.cast(a, kind).text, self.cast(b, kind).text
            ordered = "u" if name == "NotEq" else "o"
            return Scalar(BOOL, self.do(f"fcmp {ordered}{test} {kind.llvm} {left}, {right}"))
        signs = {v.type.kind for v in (a, b) if v.literal is None or v.literal < 0}
        bits, wide = 64, max(a.type.bits, b.type.bits)
        if a.type == b.type:
            bits, signs = wide, {a.type.kind}
        elif "i" in signs and signs != {"i"}:
            bits = 128 if 64 in {v.type.bits for v in (a, b) if v.type.kind == "u"} else 64
        left, right = (self._widened(v, bits) for v in (a, b))
        sign = "" if name in ("Eq", "NotEq") else "s" if "i" in signs else "u"
        return Scalar(BOOL, self.do(f"icmp {sign}{test} i{bits} {left}, {right}"))

    def _widened(self, value: Scalar, bits: int) -> str:
        if value.literal is not None:
            return str(int(value.literal)) if value.type.kind != "b" or bits > 1 else value.text
        if value.type.bits == bits:
            return value.text
        step = "sext" if value.type.kind == "i" else "zext"
        return self.do(f"{step} {value.type.llvm} {value.text} to i{bits}")

    def chosen(self, condition: Scalar, yes: Value, no: Value) -> Value | None:
        """A choice without a jump; None where the two cannot be joined so."""
        from motes.machine.block import common_type
        from motes.machine.values import register_types

        kind = common_type([yes, no])
        if kind is None:
            return None
        a, b = self.converted(yes, kind), self.converted(no, kind)
        pairs = zip(registers(a), registers(b), register_types(kind), strict=True)
        picked = [
            x if x == y else self.do(f"select i1 {condition.text}, {t} {x}, {t} {y}")
            for x, y, t in pairs
        ]
        return of_registers(kind, picked)


class Memory(Arithmetic):
    """Elements and parts of arrays and tuples."""

    def offset(self, index: Scalar) -> str:
        """An index as a 64-bit register."""
        if not index.type.whole:
            raise Unsupported("an index is an integer")
        return self.cast(index, UINT if index.type.kind != "i" else INT).text

    def element(self, array: View, places: Sequence[Scalar]) -> str:
        """Address of an element; a literal index below 0 counts from the end."""
        item = array.type.item
        indices = []
        for axis, place in enumerate(places):
            if place.literal is not None and place.literal < 0:
                indices.append(self.do(f"add nsw i64 {array.shape[axis]}, {place.literal}"))
            else:
                indices.append(self.offset(place))
        if array.type.packed:
            at = indices[0]
            for extent, index in zip(array.shape[1:], indices[1:], strict=False):
                at = self.do(f"mul nsw i64 {at}, {extent}")
                at = self.do(f"add nsw i64 {at}, {index}")
            for extent in array.shape[len(indices) :]:
                at = self.do(f"mul nsw i64 {at}, {extent}")
            return self.do(f"getelementptr inbounds {item.stored}, ptr {array.address}, i64 {at}")
        address = array.address
        for index, stride in zip(indices, array.strides, strict=False):
            step = self.do(f"mul nsw i64 {index}, {stride}")
            address = self.do(f"getelementptr inbounds i8, ptr {address}, i64 {step}")
        return address

    def load(self, array: View, places: Sequence[Scalar]) -> Value:
        """An element, or the part of the array that fewer indices than axes leave."""
        address, item, rest = self.element(array, places), array.type.item, len(places)
        if rest < array.type.axes:
            kind = Array(item, array.type.axes - rest, array.type.packed)
            return View(kind, address, array.shape[rest:], array.strides[rest:])
        register = self.do(f"load {item.stored}, ptr {address}{self.kind_of_memory(item)}")
        if item.kind == "b":
            register = self.do(f"icmp ne i8 {register}, 0")
        return Scalar(item, register)

    def store(self, array: View, places: Sequence[Scalar], value: Value) -> None:
        """Write an element."""
        if len(places) != array.type.axes or not isinstance(value, Scalar):
            raise Unsupported("only numbers can be written into elements of arrays")
        item = array.type.item
        text = self.cast(value, item).text
        if item.kind == "b":
            text = self.do(f"zext i1 {text} to i8")
        address = self.element(array, places)
        self.line(f"store {item.stored} {text}, ptr {address}{self.kind_of_memory(item)}")

    def kind_of_memory(self, item: Number) -> str:
        """A mark that tells LLVM that arrays of different types do not overlap."""
        raise NotImplementedError

    def fill(self, part: View, value: Value) -> None:
        """Write a number, or the elements of an array of the same shape, into part of an array."""
        if part.type.axes == 1:
            def write(i: Scalar) -> None:
                self.store(part, [i], value if isinstance(value, Scalar) else self.load(value, [i]))  # type: ignore[arg-type]

            if isinstance(value, View) and value.type.axes != 1:
                raise Unsupported("arrays of different shapes")
            self.counted(part.shape[0], write)
            return
        self.counted(part.shape[0], lambda i: self._fill_row(part, value, i))

    def _fill_row(self, part: View, value: Value, i: Scalar) -> None:
        row = self.load(part, [i])
        assert isinstance(row, View)
        self.fill(row, self.load(value, [i]) if isinstance(value, View) else value)

    def cut(self, array: View, axis_parts: Sequence[Scalar | tuple[Value, Value]]) -> View:
        """Part of an array by an index or a pair (first, last) for each axis that is named."""
        strides, address = self.strides(array), array.address
        shape: list[str] = []
        steps: list[str] = []
        packed = array.type.packed
        for axis, part in enumerate(axis_parts):
            extent = array.shape[axis]
            if isinstance(part, tuple):
                first, last = (self._end(end, extent, k) for k, end in enumerate(part))
                size = self.do(f"sub nsw i64 {last}, {first}")
                shape.append(self._call64("smax", size, "0"))
                steps.append(strides[axis])
                packed = packed and len(shape) == 1
            else:
                first = self.offset(part)
                packed = packed and not shape
            move = self.do(f"mul nsw i64 {first}, {strides[axis]}")
            address = self.do(f"getelementptr inbounds i8, ptr {address}, i64 {move}")
        rest = len(axis_parts)
        shape += array.shape[rest:]
        steps += strides[rest:]
        kind = Array(array.type.item, len(shape), packed)
        return View(kind, address, tuple(shape), () if packed else tuple(steps))

    def _end(self, end: Value, extent: str, last: int) -> str:
        """One end of a slice, within 0 and the extent; below 0 it counts from the array's end."""
        if isinstance(end, Known):
            return extent if last else "0"
        assert isinstance(end, Scalar)
        at = self.offset(end)
        if end.literal is None or end.literal < 0:
            if end.type.kind == "i":
                below = self.do(f"icmp slt i64 {at}, 0")
                moved = self.do(f"add nsw i64 {at}, {extent}")
                at = self.do(f"select i1 {below}, i64 {moved}, i64 {at}")
                at = self._call64("smax", at, "0")
        elif end.literal == 0:
            return "0"
        return self._call64("umin" if end.type.kind == "u" else "smin", at, extent)

    def _call64(self, name: str, a: str, b: str) -> str:
        return self.intrinsic(name, Scalar(INT, a), Scalar(INT, b)).text

    def picked(self, group: Group, index: Scalar) -> Value:
        """An item of a tuple; where the index is only known at run time, all have one type."""
        if index.literal is not None:
            try:
                return group.items[index.literal]
            except IndexError:
                raise Unsupported(f"a tuple of {len(group.items)} has no {index.literal}") from None
        from motes.machine.block import common_type

        kind = common_type(list(group.items))
        if not isinstance(kind, Number):
            raise LiteralNeeded("a tuple of arrays, or of different types, needs a literal index")
        size = len(group.items)
        room = self.room(kind, size)
        for k, item in enumerate(group.items):
            text = self.converted(item, kind)
            assert isinstance(text, Scalar)
            at = self.do(f"getelementptr inbounds {kind.llvm}, ptr {room}, i64 {k}")
            self.line(f"store {kind.llvm} {text.text}, ptr {at}")
        at = self.do(f"getelementptr inbounds {kind.llvm}, ptr {room}, i64 {self.offset(index)}")
        return Scalar(kind, self.do(f"load {kind.llvm}, ptr {at}"))

    def room(self, kind: Number, count: int) -> str:
        """Address of room for numbers on the stack."""
        register = self.register()
        self.head.lines.append(f"{register} = alloca [{count} x {kind.stored}], align 32")
        return register
