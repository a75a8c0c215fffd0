"""The types of kernels: numbers, tuples of types, arrays; and which type two of them give."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


class Unsupported(Exception):
    """A function is outside what this compiler knows, or its types do not fit."""

    place = ""
    """Where in the source text, once that is known."""

    def whole(self) -> str:
        """What is wrong and where, on one line."""
        return f"{self}: {self.place}" if self.place else str(self)


class LiteralNeeded(Unsupported):
    """An index must be known while compiling: the loop around it can be written out."""


@dataclass(frozen=True)
class Number:
    """A scalar type, named as in NumPy."""

    name: str
    kind: str
    """As in NumPy: "b" for truth values, "i" and "u" for integers, "f" for real numbers."""
    bits: int
    lanes: int = 1
    """How many of them an operation works on at once; arrays hold single ones."""

    @property
    def llvm(self) -> str:
        """LLVM's type of a value in a register."""
        name = f"i{self.bits}"
        if self.kind == "f":
            name = "float" if self.bits == 32 else "double"
        return name if self.lanes == 1 else f"<{self.lanes} x {name}>"

    def over(self, lanes: int) -> Number:
        """The same type over a number of lanes."""
        return self if lanes == self.lanes else replace(self, lanes=lanes)

    @property
    def stored(self) -> str:
        """LLVM's type of an element of an array."""
        return "i8" if self.kind == "b" else self.llvm

    @property
    def bytes(self) -> int:
        """Size of an element of an array."""
        return max(self.bits // 8, 1)

    @property
    def whole(self) -> bool:
        """Whether it is an integer or a truth value."""
        return self.kind != "f"

    def __str__(self) -> str:
        return self.name if self.lanes == 1 else f"{self.lanes} lanes of {self.name}"


@dataclass(frozen=True)
class Tuple:
    """A tuple; with `names` a named one."""

    items: tuple[Type, ...]
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"({', '.join(map(str, self.items))})"


@dataclass(frozen=True)
class Array:
    """An array of numbers; `packed` if its elements follow each other in memory without gaps."""

    item: Number
    axes: int
    packed: bool

    def __str__(self) -> str:
        return f"{self.item}[{', '.join(':' * self.axes)}]{'' if self.packed else ' with strides'}"


@dataclass(frozen=True)
class Nothing:
    """The type of None."""

    def __str__(self) -> str:
        return "None"


Type = Number | Tuple | Array | Nothing

NUMBERS = {
    name: Number(name, np.dtype(name).kind, 1 if name == "bool" else np.dtype(name).itemsize * 8)
    for name in (
        "bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64",
        "float32", "float64",
    )
}  # fmt: skip
"""The scalar types by name."""

BOOL, INT, UINT, INT32 = (NUMBERS[n] for n in ("bool", "int64", "uint64", "int32"))
SINGLE, DOUBLE = NUMBERS["float32"], NUMBERS["float64"]
NOTHING = Nothing()


def of_dtype(dtype: np.dtype[np.generic]) -> Number:
    """The number of a NumPy dtype. Raises Unsupported for others, such as complex ones."""
    if dtype.name not in NUMBERS or not dtype.isnative:
        raise Unsupported(f"{dtype} is no type of kernels")
    return NUMBERS[dtype.name]


def arithmetic(a: Number, b: Number) -> Number:
    """The type in which two numbers are added: at least 64 bits for integers."""
    if (lanes := max(a.lanes, b.lanes)) > 1:
        return arithmetic(a.over(1), b.over(1)).over(lanes)
    if a.whole and b.whole:
        return UINT if a.kind == b.kind == "u" else INT
    if a.whole or b.whole:
        whole, real = (a, b) if a.whole else (b, a)
        return real if whole.bits <= 16 else DOUBLE
    return DOUBLE if 64 in (a.bits, b.bits) else SINGLE


def joined(a: Type, b: Type) -> Type:
    """The type of a name that has one of two types, depending on the way that the code took."""
    if a == b:
        return a
    if isinstance(a, Number) and isinstance(b, Number):
        if (lanes := max(a.lanes, b.lanes)) > 1:
            return widened(joined(a.over(1), b.over(1)), lanes)
        if a.kind == b.kind:
            return a if a.bits >= b.bits else b
        return arithmetic(a, b)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        items = tuple(joined(x, y) for x, y in zip(a.items, b.items, strict=True))
        return Tuple(items, a.names if a.names == b.names else ())
    if isinstance(a, Array) and isinstance(b, Array) and (a.item, a.axes) == (b.item, b.axes):
        return Array(a.item, a.axes, False)
    raise Unsupported(f"a name is {a} on one way through the code and {b} on another")


def widened(kind: Type, lanes: int) -> Type:
    """A type whose numbers are all over a number of lanes."""
    if isinstance(kind, Number):
        return kind.over(lanes)
    if isinstance(kind, Tuple):
        return Tuple(tuple(widened(item, lanes) for item in kind.items), kind.names)
    raise Unsupported(f"{kind} cannot differ from lane to lane")
