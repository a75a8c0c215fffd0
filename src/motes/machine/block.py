"""LLVM's text of one function, in static single assignment form, and where ways through it join."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from motes.machine.kinds import BOOL, INT, Array, Nothing, Number, Tuple, Type, Unsupported, joined
from motes.machine.values import (
    Group,
    Known,
    Scalar,
    Value,
    View,
    of_registers,
    register_types,
    registers,
    type_of,
)

Names = dict[str, Value]
"""What the local names of a function stand for at one place of its code."""


@dataclass(eq=False)
class Block:
    """A basic block: straight code, and a jump at its end."""

    label: str
    lines: list[str] = field(default_factory=list)


Edge = tuple[Block, Names]
"""The end of a block that is not closed yet, and the names there."""


class Writer:
    """Writes blocks; `block` is where code goes, None after a jump that leaves."""

    def __init__(self, flags: frozenset[str]) -> None:
        self.flags = "".join(f"{flag} " for flag in sorted(flags))
        self.head = Block("head")
        """Room that the function takes on the stack."""
        self.blocks: list[Block] = []
        self._numbers = 0
        self.block: Block | None = self.new_block()

    def new_block(self) -> Block:
        """A new block at the end of the function; code goes on where it was."""
        block = Block(f"b{self._next()}")
        self.blocks.append(block)
        return block

    def _next(self) -> int:
        self._numbers += 1
        return self._numbers

    def register(self) -> str:
        """A new register."""
        return f"%v{self._next()}"

    def line(self, text: str) -> None:
        """Append an instruction without a result."""
        assert self.block is not None
        self.block.lines.append(text)

    def do(self, text: str) -> str:
        """Append an instruction; returns its register."""
        register = self.register()
        self.line(f"{register} = {text}")
        return register

    def jump(self, target: Block) -> None:
        """Close the block with a jump."""
        self.line(f"br label %{target.label}")

    def fork(self, condition: str) -> tuple[Block, Block]:
        """Close the block with a choice; returns the blocks for true and false."""
        yes, no = self.new_block(), self.new_block()
        self.line(f"br i1 {condition}, label %{yes.label}, label %{no.label}")
        return yes, no

    # ------------------------------------------------------------------ conversions

    def cast(self, value: Scalar, to: Number) -> Scalar:
        """A number as another type."""
        given = value.type
        to = to.over(max(to.lanes, given.lanes))
        if value.literal is not None:
            return literal(value.literal, to)
        if to.lanes > given.lanes:
            return self.spread(self.cast(value, to.over(1)), to.lanes)
        if given == to:
            return Scalar(to, value.text)
        if to.kind == "b":
            return self.truth(value)
        if given.whole and to.whole:
            if given.bits == to.bits:
                return Scalar(to, value.text)
            step = "trunc" if given.bits > to.bits else "sext" if given.kind == "i" else "zext"
        elif given.whole:
            step = "sitofp" if given.kind == "i" else "uitofp"
        elif to.whole:
            step = "fptosi" if to.kind == "i" else "fptoui"
        else:
            step = "fpext" if to.bits > given.bits else "fptrunc"
        return Scalar(to, self.do(f"{step} {given.llvm} {value.text} to {to.llvm}"))

    def spread(self, value: Scalar, lanes: int) -> Scalar:
        """The same number in every lane."""
        one, many = value.type, value.type.over(lanes)
        first = self.do(f"insertelement {many.llvm} poison, {one.llvm} {value.text}, i64 0")
        order = f"<{lanes} x i32> zeroinitializer"
        text = f"shufflevector {many.llvm} {first}, {many.llvm} poison, {order}"
        return Scalar(many, self.do(text))

    def truth(self, value: Value) -> Scalar:
        """Whether a number is not 0."""
        if not isinstance(value, Scalar):
            raise Unsupported("only a number can be true or false")
        if value.type.kind == "b":
            return value
        if value.literal is not None:
            return literal(bool(value.literal), BOOL)
        test, kind = "fcmp une" if value.type.kind == "f" else "icmp ne", value.type
        text = f"{test} {kind.llvm} {value.text}, {zero(kind.llvm)}"
        return Scalar(BOOL.over(kind.lanes), self.do(text))

    def converted(self, value: Value, to: Type) -> Value:
        """A value as another type that it may be joined into."""
        if isinstance(value, Scalar) and isinstance(to, Number):
            return self.cast(value, to)
        if isinstance(value, Group) and isinstance(to, Tuple):
            pairs = zip(value.items, to.items, strict=True)
            return Group(tuple(self.converted(v, t) for v, t in pairs), to.names)
        if isinstance(value, View) and isinstance(to, Array):
            strides = () if to.packed else self.strides(value)
            return View(to, value.address, value.shape, strides)
        if isinstance(value, Known) and value.thing is None and isinstance(to, Nothing):
            return value
        raise Unsupported(f"{type_of(value)} cannot become {to}")

    def strides(self, view: View) -> tuple[str, ...]:
        """Distances [bytes] between neighbours along each axis."""
        if view.strides:
            return view.strides
        steps = [str(view.type.item.bytes)]
        for extent in reversed(view.shape[1:]):
            steps.append(self.do(f"mul nsw i64 {steps[-1]}, {extent}"))
        return tuple(reversed(steps))

    # ------------------------------------------------------------------ joins

    def join(self, edges: list[Edge]) -> Names:
        """Go on where several ways meet; names that differ get a value of a common type."""
        if not edges:
            self.block = None
            return {}
        if len(edges) == 1:
            self.block = edges[0][0]
            return edges[0][1]
        every = {name for _, names in edges for name in names}
        result: Names = {}
        common: dict[str, Type] = {}
        for name in sorted(every):
            found = [names[name] for _, names in edges if name in names]
            alike = all(_same(v, found[0]) for v in found)
            if alike and (len(found) == len(edges) or isinstance(found[0], Known)):
                result[name] = found[0]
            elif (kind := common_type(found)) is not None:
                common[name] = kind
        incoming: list[tuple[Block, list[str]]] = []
        for block, names in edges:
            self.block = block
            into: list[str] = []
            for name, kind in common.items():
                if name in names:
                    into += registers(self.converted(names[name], kind))
                else:
                    into += [zero(t) for t in register_types(kind)]
            incoming.append((block, into))
        meeting = self.new_block()
        for block, _ in edges:
            self.block = block
            self.jump(meeting)
        self.block = meeting
        at = 0
        for name, kind in common.items():
            kinds = register_types(kind)
            phis = []
            for k, llvm in enumerate(kinds, at):
                ways = ", ".join(f"[ {into[k]}, %{block.label} ]" for block, into in incoming)
                phis.append(self.do(f"phi {llvm} {ways}"))
            at += len(kinds)
            result[name] = of_registers(kind, phis)
        return result

    def counted(self, count: str, body: Any) -> None:
        """A loop that calls `body(index)` to write its code for index 0, 1, ... count - 1."""
        self.carried("0", count, (), lambda index, _: body(index) or ())

    def carried(
        self,
        first: str,
        last: str,
        values: Sequence[Scalar],
        body: Callable[..., Any],
        mark: str = "",
    ) -> list[Scalar]:
        """A loop of `values = body(index, values)` for index first, ... last - 1.

        `mark` tells the compiler something of its jump back.
        """
        before = self.block
        assert before is not None
        top = self.new_block()
        self.jump(top)
        self.block = top
        begin = [Scalar(INT, first), *values]
        names = [Scalar(value.type, self.register()) for value in begin]
        phi = len(top.lines)
        index = names[0]
        inside, after = self.fork(self.do(f"icmp slt i64 {index.text}, {last}"))
        self.block = inside
        found = body(index, names[1:])
        end = [Scalar(INT, self.do(f"add nsw i64 {index.text}, 1")), *found]
        assert self.block is not None
        top.lines[phi:phi] = [
            f"{name.text} = phi {name.type.llvm} "
            f"[ {a.text}, %{before.label} ], [ {b.text}, %{self.block.label} ]"
            for name, a, b in zip(names, begin, end, strict=True)
        ]
        self.line(f"br label %{top.label}{mark}")
        self.block = after
        return names[1:]


def _same(a: Value, b: Value) -> bool:
    """Whether two values are the same thing, known or in the same registers."""
    if isinstance(a, Known) or isinstance(b, Known):
        return isinstance(a, Known) and isinstance(b, Known) and a.thing is b.thing
    return a is b


def common_type(values: list[Value]) -> Type | None:
    """The type of a name that stands for one of several values; None if they cannot be joined.

    A bare integer takes the type of what it meets.
    """
    try:
        typed = [v for v in values if not (isinstance(v, Scalar) and v.bare)] or values
        kind = type_of(typed[0])
        for value in typed[1:]:
            kind = joined(kind, type_of(value))
        for value in values:
            if isinstance(value, Scalar) and value.bare:
                whole = isinstance(kind, Number) and kind.kind in "iu"
                if not (whole and value.type == INT):
                    kind = joined(kind, value.type)
        return kind
    except Unsupported:
        return None


def zero(llvm: str) -> str:
    """Zero of one of LLVM's types."""
    if llvm.startswith("<"):
        return "zeroinitializer"
    return {"ptr": "null", "float": "0.0", "double": "0.0", "i1": "false"}.get(llvm, "0")


def literal(value: Any, kind: Number, bare: bool = False) -> Scalar:
    """A number that is known while compiling, as a type."""
    if kind.lanes > 1:
        one = literal(value, kind.over(1), bare)
        each = ", ".join([f"{one.type.llvm} {one.text}"] * kind.lanes)
        return Scalar(kind, f"<{each}>", one.literal, bare)
    if kind.kind == "b":
        return Scalar(kind, "true" if value else "false", bool(value), bare)
    if kind.whole:
        whole = int(value) & ((1 << kind.bits) - 1)
        if kind.kind == "i" and whole >> (kind.bits - 1):
            whole -= 1 << kind.bits
        return Scalar(kind, str(whole), whole, bare)
    import numpy as np

    with np.errstate(over="ignore"):
        real = float(np.float32(value)) if kind.bits == 32 else float(value)
    bits = struct.unpack("<Q", struct.pack("<d", real))[0]
    return Scalar(kind, f"0x{bits:016X}", real, bare)
