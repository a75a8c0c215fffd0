"""The types of kernels: numbers, tuples of types, arrays; and which type two of them give."""

from __future__ import annotations

from dataclasses import dataclass

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

    @property
    def llvm(self) -> str:
        """LLVM's type of a value in a register."""
        if self.kind == "f":
            return "float" if self.bits == 32 else "double"
        return f"i{self.bits}"

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
        return self.name


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
        if a.kind == b.kind:
            return a if a.bits >= b.bits else b
        return arithmetic(a, b)
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        items = tuple(joined(x, y) for x, y in zip(a.items, b.items, strict=True))
        return Tuple(items, a.names if a.names == b.names else ())
    if isinstance(a, Array) and isinstance(b, Array) and (a.item, a.axes) == (b.item, b.axes):
        return Array(a.item, a.axes, False)
    raise Unsupported(f"a name is {a} on one way through the code and {b} on another")
