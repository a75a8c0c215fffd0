"""One function: a walk over its syntax tree that finds types and writes LLVM's text at once.

Code that a known condition excludes is not looked at.
"""

from __future__ import annotations

import types
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from motes.machine.block import Edge, Names, common_type
from motes.machine.kinds import Array, Number, Tuple, Type, Unsupported
from motes.machine.loops import Loops
from motes.machine.source import Source
from motes.machine.statements import Loop
from motes.machine.syntax import RETURNED
from motes.machine.values import (
    Known,
    Value,
    of_registers,
    register_types,
    registers,
    type_of,
)

if TYPE_CHECKING:
    from motes.machine.module import Module


class Function(Loops):
    """Writes one function for one list of argument types."""

    def __init__(
        self,
        module: Module,
        function: types.FunctionType,
        arguments: Sequence[Type],
        flags: frozenset[str],
    ) -> None:
        super().__init__(flags)
        self.module, self.source = module, Source.of(function)
        self._returns: list[Edge] = []
        self._loops: list[Loop] = []
        self._heap: list[str] = []
        self._rooms: list[tuple[str, Number, int]] = []
        self.names: Names = {}
        self.heads: list[str] = []
        if len(arguments) != len(self.source.parameters):
            raise Unsupported(
                f"{function.__name__} takes {len(self.source.parameters)} arguments, "
                f"not {len(arguments)}"
            )
        for name, kind in zip(self.source.parameters, arguments, strict=True):
            passed = [(t, f"%a{len(self.heads) + k}") for k, t in enumerate(register_types(kind))]
            self.heads += [f"{t} {r}" for t, r in passed]
            self.names[name] = of_registers(kind, [r for _, r in passed])
        self.result: Type = self._write()
        if self._heap and _has_array(self.result):
            raise Unsupported("a function returns an array whose size is not known")

    def _write(self) -> Type:
        self.statements(self.source.body)
        if self.block is not None:
            self._returns.append((self.block, {RETURNED: Known(None)}))
        values = [names[RETURNED] for _, names in self._returns]
        kind = common_type(values)
        if kind is None:
            raise Unsupported("the function returns values of types that do not fit together")
        edges: list[Edge] = []
        for block, names in self._returns:
            self.block = block
            edges.append((block, {RETURNED: self.converted(names[RETURNED], kind)}))
        result = self.join(edges)[RETURNED]
        for address in self._heap:
            self.declare("declare void @motes_free(ptr)")
            held = self.do(f"load ptr, ptr {address}")
            self.line(f"call void @motes_free(ptr {held})")
        texts, kinds = registers(result), register_types(kind)
        if len(texts) == 1:
            self.line(f"ret {kinds[0]} {texts[0]}")
        elif texts:
            whole, packed = f"{{ {', '.join(kinds)} }}", "poison"
            for k, (llvm, text) in enumerate(zip(kinds, texts, strict=True)):
                packed = self.do(f"insertvalue {whole} {packed}, {llvm} {text}, {k}")
            self.line(f"ret {whole} {packed}")
        else:
            self.line("ret void")
        return kind

    @property
    def lent(self) -> tuple[tuple[Number, int], ...]:
        """Room that the caller lends, because an array that is returned may lie in it."""
        lends = _has_array(self.result)
        return tuple((kind, count) for _, kind, count in self._rooms) if lends else ()

    def text(self, name: str, attributes: str) -> str:
        """The function's definition."""
        first, heads, rooms = self.blocks[0], list(self.heads), []
        for register, kind, count in self._rooms:
            if self.lent:
                heads.append(f"ptr {register}")
            else:
                rooms.append(f"{register} = alloca [{count} x {kind.stored}], align 32")
        lines = [f"define internal {returned(self.result)} @{name}({', '.join(heads)})"
                 f" {attributes} {{"]  # fmt: skip
        lines += ["head:", *rooms, *self.head.lines, f"br label %{first.label}"]
        for block in self.blocks:
            if block.lines:
                lines += [f"{block.label}:", *block.lines]
        return "\n".join([*lines, "}"])

    def declare(self, text: str) -> None:
        """Declare a function outside of the module."""
        self.module.declarations.add(text)

    def written(self, name: str, text: str) -> None:
        """See to it that the module holds a function whose text is known."""
        self.module.known.setdefault(name, text)

    def kind_of_memory(self, item: Number) -> str:
        """The mark of an array's type."""
        return self.module.kind_of_memory(item)

    def room(self, kind: Number, count: int) -> str:
        """Room on the stack, or lent by the caller where the function returns an array."""
        register = self.register()
        self._rooms.append((register, kind, count))
        return register

    def heap(self, bytes: str) -> str:
        """Memory that is given back at the end."""
        if self._loops:
            raise Unsupported("an array made inside a loop")
        place = self.register()
        self.head.lines += [f"{place} = alloca ptr", f"store ptr null, ptr {place}"]
        self._heap.append(place)
        self.declare("declare noalias ptr @motes_malloc(i64)")
        address = self.do(f"call noalias ptr @motes_malloc(i64 {bytes})")
        self.line(f"store ptr {address}, ptr {place}")
        return address

    def call_function(
        self, thing: Any, function: types.FunctionType, arguments: Sequence[Value]
    ) -> Value:
        """A call of another function of the module, which is written first."""
        defaults = function.__defaults__ or ()
        missing = len(Source.of(function).parameters) - len(arguments)
        if 0 < missing <= len(defaults):
            arguments = [*arguments, *(self.constant(d) for d in defaults[-missing:])]
        kinds = tuple(type_of(a) for a in arguments)
        name, result, lent = self.module.function(thing, function, kinds, self.flags)
        if lent and self._loops:
            raise Unsupported("a function that returns an array of its own, called inside a loop")
        passed = [
            f"{t} {r}"
            for a, kind in zip(arguments, kinds, strict=True)
            for t, r in zip(register_types(kind), registers(a), strict=True)
        ]
        passed += [f"ptr {self.room(kind, count)}" for kind, count in lent]
        call = f"call {returned(result)} @{name}({', '.join(passed)})"
        kinds_out = register_types(result)
        if not kinds_out:
            self.line(call)
            return Known(None)
        whole = self.do(call)
        if len(kinds_out) == 1:
            return of_registers(result, [whole])
        struct = f"{{ {', '.join(kinds_out)} }}"
        parts = [self.do(f"extractvalue {struct} {whole}, {k}") for k in range(len(kinds_out))]
        return of_registers(result, parts)


def _has_array(kind: Type) -> bool:
    return isinstance(kind, Array) or (
        isinstance(kind, Tuple) and any(_has_array(item) for item in kind.items)
    )


def returned(kind: Type) -> str:
    """LLVM's type of what a function returns."""
    kinds = register_types(kind)
    if not kinds:
        return "void"
    return kinds[0] if len(kinds) == 1 else f"{{ {', '.join(kinds)} }}"
