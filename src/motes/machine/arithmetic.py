"""Arithmetic and comparisons of numbers as LLVM's text."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

from motes.machine.block import Writer, common_type, literal, zero
from motes.machine.kinds import (
    BOOL,
    DOUBLE,
    INT,
    UINT,
    Number,
    Unsupported,
    arithmetic,
    widened,
)
from motes.machine.values import Group, Scalar, Value, of_registers, register_types, registers

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
                    return UINT.over(other.type.lanes)
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
            lanes = max(a.type.lanes, b.type.lanes)
            kind = BOOL.over(lanes) if both else self.together(a, b)
            if not kind.whole:
                raise Unsupported("operators of bits work on integers only")
            return self._plain(BITS[name], kind, a, b)
        if name in ("LShift", "RShift"):
            kind = arithmetic(a.type, a.type)
            step = "shl" if name == "LShift" else "lshr" if kind.kind == "u" else "ashr"
            return self._plain(step, kind, a, b)
        kind = self.together(a, b)
        if name == "Div" and kind.whole:
            kind = DOUBLE.over(kind.lanes)
        if kind.kind == "f":
            if name in REAL:
                return self._plain(f"{REAL[name]} {self.flags}".strip(), kind, a, b)
            return self._floored_real(name, self.cast(a, kind), self.cast(b, kind))
        if name in WHOLE:
            return self._plain(WHOLE[name], kind, a, b)
        if kind.lanes > 1:
            raise Unsupported("integers are not divided lane by lane")
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

    def power(self, a: Scalar, b: Scalar) -> Value:
        """A power: products and a root for small exponents that are multiples of a half."""
        if b.literal is None or 2 * b.literal % 1 or abs(b.literal) > PRODUCTS:
            if a.type.whole and b.type.whole:
                raise Unsupported("a power of integers needs a small exponent that is known")
            return self.formula("pow", [a, b])
        kind = a.type if a.type.kind == "f" else DOUBLE if b.literal % 1 else INT
        square: Value = self.cast(a, kind)
        result: Value | None = None
        if b.literal % 1:
            result = self.intrinsic("sqrt", self.cast(a, kind))
        rest = abs(int(b.literal))
        while rest:
            if rest & 1:
                result = square if result is None else self.binary("Mult", result, square)
            rest >>= 1
            if rest:
                square = self.binary("Mult", square, square)
        found = literal(1, kind) if result is None else result
        return self.binary("Div", literal(1, kind), found) if b.literal < 0 else found

    def intrinsic(self, name: str, *values: Scalar) -> Scalar:
        """One of LLVM's own functions on numbers of one type."""
        kind = values[0].type
        arguments = ", ".join(f"{kind.llvm} {v.text}" for v in values)
        suffix = f"f{kind.bits}" if kind.kind == "f" else f"i{kind.bits}"
        suffix = suffix if kind.lanes == 1 else f"v{kind.lanes}{suffix}"
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

    def formula(self, name: str, arguments: Sequence[Value]) -> Value:
        """An elementary function, by the project's own formula for the arguments' precision."""
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
        text = f"sub {kind.llvm} {zero(kind.llvm)}, {self.cast(value, kind).text}"
        return Scalar(kind, self.do(text))

    def compare(self, name: str, a: Scalar, b: Scalar) -> Scalar:
        """A comparison, by its name in Python's syntax tree; false with NaN, except !=."""
        if a.literal is not None and b.literal is not None:
            known = {
                "Lt": operator.lt, "LtE": operator.le, "Gt": operator.gt, "GtE": operator.ge,
                "Eq": operator.eq, "NotEq": operator.ne,
            }[name](a.literal, b.literal)  # fmt: skip
            return literal(known, BOOL)
        test, lanes = ORDER[name], max(a.type.lanes, b.type.lanes)
        if not (a.type.whole and b.type.whole):
            kind = self.together(a, b)
            left, right = self.cast(a, kind).text, self.cast(b, kind).text
            ordered = "u" if name == "NotEq" else "o"
            text = f"fcmp {ordered}{test} {kind.llvm} {left}, {right}"
            return Scalar(BOOL.over(lanes), self.do(text))
        if lanes > 1:
            return self._compared_lanes(name, a, b)
        signs = {v.type.kind for v in (a, b) if v.literal is None or v.literal < 0}
        bits, wide = 64, max(a.type.bits, b.type.bits)
        if a.type == b.type:
            bits, signs = wide, {a.type.kind}
        elif "i" in signs and signs != {"i"}:
            bits = 128 if 64 in {v.type.bits for v in (a, b) if v.type.kind == "u"} else 64
        left, right = (self._widened(v, bits) for v in (a, b))
        sign = "" if name in ("Eq", "NotEq") else "s" if "i" in signs else "u"
        return Scalar(BOOL, self.do(f"icmp {sign}{test} i{bits} {left}, {right}"))

    def _compared_lanes(self, name: str, a: Scalar, b: Scalar) -> Scalar:
        """A comparison of integers lane by lane, in the type that they have, or are added in."""
        alike = a.type.over(1) == b.type.over(1)
        kind = a.type.over(max(a.type.lanes, b.type.lanes)) if alike else self.together(a, b)
        left, right = self.cast(a, kind).text, self.cast(b, kind).text
        sign = "" if name in ("Eq", "NotEq") else "s" if kind.kind == "i" else "u"
        text = f"icmp {sign}{ORDER[name]} {kind.llvm} {left}, {right}"
        return Scalar(BOOL.over(kind.lanes), self.do(text))

    def _widened(self, value: Scalar, bits: int) -> str:
        if value.literal is not None:
            return str(int(value.literal)) if value.type.kind != "b" or bits > 1 else value.text
        if value.type.bits == bits:
            return value.text
        step = "sext" if value.type.kind == "i" else "zext"
        return self.do(f"{step} {value.type.llvm} {value.text} to i{bits}")

    def chosen(self, condition: Scalar, yes: Value, no: Value) -> Value | None:
        """A choice without a jump; None where the two cannot be joined so."""
        kind = common_type([yes, no])
        if kind is None:
            return None
        if (lanes := condition.type.lanes) > 1:
            kind = widened(kind, lanes)
        a, b = self.converted(yes, kind), self.converted(no, kind)
        pairs = zip(registers(a), registers(b), register_types(kind), strict=True)
        picked = [
            x
            if x == y
            else self.do(f"select {condition.type.llvm} {condition.text}, {t} {x}, {t} {y}")
            for x, y, t in pairs
        ]
        return of_registers(kind, picked)
