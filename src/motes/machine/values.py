"""What expressions stand for while a function is compiled.

A value is one or several registers of LLVM with a type: tuples are never built in memory, and an
array is its address with its shape. What is known without running the code (functions, types,
modules, None) is a `Known`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from motes.machine.kinds import NOTHING, Array, Number, Tuple, Type, Unsupported


@dataclass(frozen=True, eq=False)
class Scalar:
    """A number in a register."""

    type: Number
    text: str
    """The register, or the number as LLVM writes it."""
    literal: Any = None
    """The number itself, where it is known."""
    bare: bool = False
    """Whether it was written without a type, so that an integer may become unsigned."""


@dataclass(frozen=True, eq=False)
class Group:
    """A tuple of values."""

    items: tuple[Value, ...]
    names: tuple[str, ...] = ()

    @property
    def type(self) -> Tuple:
        """The tuple's type."""
        return Tuple(tuple(type_of(item) for item in self.items), self.names)


@dataclass(frozen=True, eq=False)
class View:
    """An array: the address of its first element, its shape, and its strides [bytes]."""

    type: Array
    address: str
    shape: tuple[str, ...]
    strides: tuple[str, ...] = ()
    """Empty where the array is packed."""


@dataclass(frozen=True, eq=False)
class Known:
    """Something that is known while compiling: a function, a type, a module, None."""

    thing: Any


Value = Scalar | Group | View | Known


def type_of(value: Value) -> Type:
    """Type of a value that can be stored. Raises Unsupported for functions and the like."""
    if isinstance(value, Known):
        if value.thing is None:
            return NOTHING
        raise Unsupported(f"{value.thing!r} cannot be kept in a tuple or passed on")
    return value.type


def registers(value: Value) -> list[str]:
    """All registers of a value, in a fixed order."""
    if isinstance(value, Scalar):
        return [value.text]
    if isinstance(value, Group):
        return [r for item in value.items for r in registers(item)]
    if isinstance(value, View):
        return [value.address, *value.shape, *value.strides]
    type_of(value)
    return []


def register_types(type: Type) -> list[str]:
    """LLVM's types of the registers of a type."""
    if isinstance(type, Number):
        return [type.llvm]
    if isinstance(type, Tuple):
        return [t for item in type.items for t in register_types(item)]
    if isinstance(type, Array):
        return ["ptr"] + ["i64"] * (type.axes if type.packed else 2 * type.axes)
    return []


def of_registers(type: Type, names: Sequence[str] | Iterator[str]) -> Value:
    """The value of a type in given registers."""
    source = iter(names)
    if isinstance(type, Number):
        return Scalar(type, next(source))
    if isinstance(type, Tuple):
        return Group(tuple(of_registers(item, source) for item in type.items), type.names)
    if isinstance(type, Array):
        address = next(source)
        shape = tuple(next(source) for _ in range(type.axes))
        strides = () if type.packed else tuple(next(source) for _ in range(type.axes))
        return View(type, address, shape, strides)
    return Known(None)


class Written:
    """Something that kernels call and that writes its own code."""

    formula: Callable[..., Any]
    """What the code follows from."""

    def write(self, writer: Any, values: Sequence[Value]) -> Value:
        """Write the code of a call with given arguments; returns what it gives."""
        raise NotImplementedError
