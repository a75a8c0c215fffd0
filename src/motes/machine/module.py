"""A module of LLVM's text: a kernel, all functions that it calls, and the door for Python."""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import Any

from motes.machine.calls import plain_function
from motes.machine.function import Function, returned
from motes.machine.types import Number, Type, Unsupported
from motes.machine.values import register_types

ENTRY = "motes_entry"
"""Name of the function that Python calls: it reads arguments of 8 bytes each from memory."""

PLAIN = "nounwind mustprogress"


class Module:
    """Functions by what they are, with the types of their arguments."""

    def __init__(self) -> None:
        self.declarations: set[str] = set()
        self._functions: dict[Any, tuple[str, Type] | None] = {}
        self._texts: list[str] = []
        self._memory: dict[Number, int] = {}

    def function(
        self, thing: Any, function: types.FunctionType, kinds: Sequence[Type], flags: Any
    ) -> tuple[str, Type]:
        """Name and type of the result of a function for arguments of given types.

        `thing` is what is called: a kernel has flags of its own, a plain function those given.
        """
        flags = getattr(thing, "flags", flags if isinstance(flags, frozenset) else None)
        flags = frozenset(flags.split()) if isinstance(flags, str) else flags
        key = (function, flags, tuple(kinds))
        if key in self._functions:
            known = self._functions[key]
            if known is None:
                raise Unsupported(f"{function.__name__} calls itself")
            return known
        self._functions[key] = None
        writer = Function(self, function, kinds, flags)
        name = f"{function.__name__}.{len(self._functions)}"
        inline = "alwaysinline " if getattr(thing, "inline", True) else ""
        self._texts.append(writer.text(name, f"{inline}{PLAIN}"))
        self._functions[key] = name, writer.result
        return name, writer.result

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
        parts = [*sorted(self.declarations), *self._texts, door(name, result, kinds), *tables]
        return "\n".join(parts)


def door(name: str, result: Type, kinds: Sequence[Type]) -> str:
    """A function of two addresses: the arguments, and where the result goes, 8 bytes a number."""
    lines, passed, place = [], [], 0
    for kind in kinds:
        for llvm in register_types(kind):
            at = f"%p{place}"
            lines.append(f"{at} = getelementptr inbounds i64, ptr %from, i64 {place}")
            wide = {"float": "double", "double": "double", "ptr": "ptr"}.get(llvm, "i64")
            lines.append(f"%w{place} = load {wide}, ptr {at}")
            if wide == llvm:
                passed.append(f"{llvm} %w{place}")
            else:
                step = "fptrunc" if llvm == "float" else "trunc"
                lines.append(f"%v{place} = {step} {wide} %w{place} to {llvm}")
                passed.append(f"{llvm} %v{place}")
            place += 1
    out = register_types(result)
    call = f"call {returned(result)} @{name}({', '.join(passed)})"
    lines.append(f"%result = {call}" if out else call)
    for k, llvm in enumerate(out):
        value = "%result"
        if len(out) > 1:
            value = f"%r{k}"
            lines.append(f"{value} = extractvalue {returned(result)} %result, {k}")
        if llvm == "float":
            lines.append(f"%x{k} = fpext float {value} to double")
            value, llvm = f"%x{k}", "double"
        lines.append(f"%o{k} = getelementptr inbounds i64, ptr %to, i64 {k}")
        lines.append(f"store {llvm} {value}, ptr %o{k}")
    body = "\n".join(lines)
    return f"define void @{ENTRY}(ptr noalias %from, ptr noalias %to) {PLAIN} {{\n{body}\nret void\n}}"


def compiled_text(kernel: Any, kinds: Sequence[Type]) -> tuple[str, Type]:
    """LLVM's text of a kernel for argument types, and the type of its result."""
    module, function = Module(), plain_function(kernel)
    assert function is not None
    name, result = module.function(kernel, function, kinds, frozenset())
    return module.text(name, result, kinds), result
