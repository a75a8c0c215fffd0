"""A module of LLVM's text: a kernel, all functions that it calls, and the door for Python."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any, NamedTuple

from motes.machine.block import Writer
from motes.machine.calls import plain_function
from motes.machine.function import Function, returned
from motes.machine.kinds import DOUBLE, INT, Array, Number, Tuple, Type, Unsupported
from motes.machine.values import Scalar, register_types

ENTRY = "motes_entry"
"""Name of the function that Python calls: it reads arguments of 8 bytes each from memory."""

EACH = "motes_each"
"""Name of the function that runs the first for many packs of arguments, whose number threads take
from a common counter."""

PLAIN = 'nounwind mustprogress "stackrealign"'
"""What holds of every function. Vectors that find no register are kept on the stack, where those
that cross a line of the cache take longer."""

_WORD = 8
_HEAD = object.__basicsize__
FIELDS = {"data": _HEAD, "shape": _HEAD + 2 * _WORD, "strides": _HEAD + 3 * _WORD}
"""Where NumPy's arrays (PyArrayObject_fields in its C interface) keep what a kernel needs."""


class Made(NamedTuple):
    """A function of a module."""

    name: str
    result: Type
    lent: tuple[tuple[Number, int], ...]
    """Room that its caller lends."""


class Module:
    """Functions by what they are, with the types of their arguments."""

    def __init__(self) -> None:
        self.declarations: set[str] = set()
        self.known: dict[str, str] = {}
        """Functions whose text does not follow from Python's, by name."""
        self._functions: dict[Any, Made | None] = {}
        self._texts: list[str] = []
        self._memory: dict[Number, int] = {}

    def function(
        self, thing: Any, function: types.FunctionType, kinds: Sequence[Type], flags: Any
    ) -> Made:
        """A function for arguments of given types: its name, its result, the room that it takes.

        `thing` is what is called: a kernel has flags of its own, a plain function those given.
        """
        flags = getattr(thing, "flags", flags)
        flags = frozenset(flags.split()) if isinstance(flags, str) else flags
        key = (function, flags, tuple(kinds))
        if key in self._functions:
            known = self._functions[key]
            if known is None:
                raise Unsupported(f"{function.__name__} calls itself")
            return known
        self._functions[key] = None
        name = f"{function.__name__.strip('<>')}.{len(self._functions)}"
        writer = Function(self, function, kinds, flags)
        inline = "alwaysinline" if getattr(thing, "inline", True) else "noinline"
        self._texts.append(writer.text(name, f"{inline} {PLAIN}"))
        self._functions[key] = made = Made(name, writer.result, writer.lent)
        return made

    def kind_of_memory(self, item: Number) -> str:
        """The mark of loads and stores of a type of number."""
        number = self._memory.setdefault(item, len(self._memory))
        return f", !tbaa !{2 * number + 2}"

    def text(self, name: str, result: Type, kinds: Sequence[Type]) -> str:
        """The module's text, with a door to one of its functions."""
        tables = ['!0 = !{!"memory"}']
        for item, number in self._memory.items():
            first = 2 * number + 1
            tables.append(f'!{first} = !{{!"{item.name}", !0, i64 0}}')
            tables.append(f"!{first + 1} = !{{!{first}, !{first}, i64 0}}")
        if any(ROLLED in text for text in self._texts):
            tables += [f"{ROLLED} = distinct !{{{ROLLED}, {ROLLED}0}}", ROLLED_MEANS]
        written = [*self.known.values(), *self._texts]
        parts = [*sorted(self.declarations), *written, door(name, result, kinds), *tables]
        return "\n".join(parts)


ROLLED = "!999999"
"""Mark of the jump back of a loop that is to stay one."""

ROLLED_MEANS = f'{ROLLED}0 = !{{!"llvm.loop.unroll.disable"}}'


def door(name: str, result: Type, kinds: Sequence[Type]) -> str:
    """A function of two addresses: the arguments, and where the result goes, 8 bytes a number.

    An array comes as the address of NumPy's object, which is read here.
    """
    writer = Writer(frozenset())
    place = 0

    def argument(llvm: str) -> str:
        nonlocal place
        at = writer.do(f"getelementptr inbounds i64, ptr %from, i64 {place}")
        place += 1
        return writer.do(f"load {llvm}, ptr {at}")

    def taken(kind: Type) -> list[str]:
        if isinstance(kind, Number):
            wide = "double" if kind.kind == "f" else "i64"
            number = argument(wide)
            if wide != kind.llvm:
                step = "fptrunc" if kind.kind == "f" else "trunc"
                number = writer.do(f"{step} {wide} {number} to {kind.llvm}")
            return [number]
        if isinstance(kind, Tuple):
            return [register for item in kind.items for register in taken(item)]
        if not isinstance(kind, Array):
            return []
        thing = argument("ptr")
        found = [writer.do(f"load ptr, ptr {field(thing, 'data')}")]
        for name in ("shape",) if kind.packed else ("shape", "strides"):
            numbers = writer.do(f"load ptr, ptr {field(thing, name)}")
            for axis in range(kind.axes):
                at = writer.do(f"getelementptr inbounds i64, ptr {numbers}, i64 {axis}")
                found.append(writer.do(f"load i64, ptr {at}"))
        return found

    def field(thing: str, name: str) -> str:
        return writer.do(f"getelementptr inbounds i8, ptr {thing}, i64 {FIELDS[name]}")

    passed = [
        f"{llvm} {register}"
        for kind in kinds
        for llvm, register in zip(register_types(kind), taken(kind), strict=True)
    ]
    out = register_types(result)
    call = f"call {returned(result)} @{name}({', '.join(passed)})"
    whole = ""
    if out:
        whole = writer.do(call)
    else:
        writer.line(call)
    for k, kind in enumerate(numbers_of(result)):
        value = whole
        if len(out) > 1:
            value = writer.do(f"extractvalue {returned(result)} {whole}, {k}")
        number = writer.cast(Scalar(kind, value), DOUBLE if kind.kind == "f" else INT)
        at = writer.do(f"getelementptr inbounds i64, ptr %to, i64 {k}")
        writer.line(f"store {number.type.llvm} {number.text}, ptr {at}")
    body = "\n".join(writer.blocks[0].lines)
    entry = (
        f"define void @{ENTRY}(ptr noalias %from, ptr noalias %to) {PLAIN} {{\n{body}\nret void\n}}"
    )
    return entry if out else f"{entry}\n{each()}"


def each() -> str:
    """The door's loop: packs of `stride` bytes until `most` are done or all `count` are taken."""
    return (
        f"define void @{EACH}(ptr %from, i64 %stride, ptr %next, i64 %count, i64 %most) "
        f"nounwind {{\nhead:\n  br label %top\ntop:\n"
        "  %done = phi i64 [ 0, %head ], [ %more, %body ]\n"
        "  %enough = icmp sge i64 %done, %most\n"
        "  br i1 %enough, label %end, label %take\ntake:\n"
        "  %k = atomicrmw add ptr %next, i64 1 seq_cst\n"
        "  %over = icmp sge i64 %k, %count\n  br i1 %over, label %end, label %body\nbody:\n"
        "  %offset = mul i64 %k, %stride\n"
        "  %pack = getelementptr inbounds i8, ptr %from, i64 %offset\n"
        f"  call void @{ENTRY}(ptr %pack, ptr null)\n"
        "  %more = add i64 %done, 1\n  br label %top\nend:\n  ret void\n}"
    )


def numbers_of(kind: Type) -> list[Number]:
    """All numbers of a result, which holds no arrays."""
    if isinstance(kind, Number):
        return [kind]
    return [n for item in kind.items for n in numbers_of(item)] if isinstance(kind, Tuple) else []


def compiled_text(kernel: Any, kinds: Sequence[Type]) -> tuple[str, Type]:
    """LLVM's text of a kernel for argument types, and the type of its result."""
    module, function = Module(), plain_function(kernel)
    assert function is not None
    name, result, _ = module.function(kernel, function, kinds, frozenset())
    return module.text(name, result, kinds), result
