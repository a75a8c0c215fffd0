"""One function: a walk over its syntax tree that finds types and writes LLVM's text at once.

A loop is written with the types that names have at its entrance; where its end has others, it is
written again with the types of both. Code that a known condition excludes is not looked at.
"""

from __future__ import annotations

import ast
import builtins
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.machine.block import Block, Edge, Names, common_type, literal, zero
from motes.machine.calls import Calls, constant
from motes.machine.source import Source
from motes.machine.types import BOOL, DOUBLE, INT, UINT, LiteralNeeded, Number, Type, Unsupported, joined
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

if TYPE_CHECKING:
    from motes.machine.module import Module

MOST_WRITTEN = 64
"""Turns of the longest loop that is written out."""

RETURNED = "return"
"""The name, impossible in Python, of what the function returns."""


@dataclass
class _Loop:
    """Where `break` and `continue` of the innermost loop go."""

    breaks: list[Edge] = field(default_factory=list)
    continues: list[Edge] = field(default_factory=list)


class Function(Calls):
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
        self._loops: list[_Loop] = []
        self._heap: list[str] = []
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

    # ------------------------------------------------------------------ the whole

    def _write(self) -> Type:
        for statement in self.source.body:
            try:
                self.statement(statement)
            except Unsupported as fault:
                if not fault.__notes__ if hasattr(fault, "__notes__") else True:
                    fault.add_note(self.source.place(statement))
                raise
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

    def text(self, name: str, attributes: str) -> str:
        """The function's definition."""
        first = self.blocks[0]
        lines = [f"define internal {returned(self.result)} @{name}({', '.join(self.heads)})"
                 f" {attributes} {{"]  # fmt: skip
        lines += ["head:", *self.head.lines, f"br label %{first.label}"]
        for block in self.blocks:
            if block.lines:
                lines += [f"{block.label}:", *block.lines]
        return "\n".join([*lines, "}"])

    def declare(self, text: str) -> None:
        self.module.declarations.add(text)

    def kind_of_memory(self, item: Number) -> str:
        return self.module.kind_of_memory(item)

    def heap(self, bytes: str) -> str:
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
        defaults = function.__defaults__ or ()
        missing = len(Source.of(function).parameters) - len(arguments)
        if 0 < missing <= len(defaults):
            arguments = [*arguments, *(constant(d) for d in defaults[-missing:])]
        kinds = tuple(type_of(a) for a in arguments)
        name, result = self.module.function(thing, function, kinds, self.flags)
        passed = [
            f"{t} {r}"
            for a, kind in zip(arguments, kinds, strict=True)
            for t, r in zip(register_types(kind), registers(a), strict=True)
        ]
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

    # ------------------------------------------------------------------ statements

    def statements(self, body: Sequence[ast.stmt]) -> None:
        """Several statements; what follows a jump is not looked at."""
        for statement in body:
            if self.block is None:
                return
            self.statement(statement)

    def statement(self, node: ast.stmt) -> None:
        """One statement."""
        if self.block is None:
            return
        handler = getattr(self, f"_on_{type(node).__name__}", None)
        if handler is None:
            raise Unsupported(f"{type(node).__name__} is not a statement of kernels")
        try:
            handler(node)
        except Unsupported as fault:
            if not getattr(fault, "__notes__", None):
                fault.add_note(self.source.place(node))
            raise

    def _on_Assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _on_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.value(node.value))

    def _on_AugAssign(self, node: ast.AugAssign) -> None:
        target = node.target
        if isinstance(target, ast.Subscript):
            array, places = self.value(target.value), self._places(target.slice)
            if isinstance(array, View) and all(isinstance(p, Scalar) for p in places):
                old = self.load(array, places)  # type: ignore[arg-type]
                new = self.binary(type(node.op).__name__, old, self.value(node.value))
                self.store(array, places, new)  # type: ignore[arg-type]
                return
            raise Unsupported("an operation on part of an array in place")
        assert isinstance(target, ast.Name)
        old = self.value(ast.Name(target.id, ast.Load()))
        self.names[target.id] = self.binary(type(node.op).__name__, old, self.value(node.value))

    def _on_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.value(node.value)

    def _on_Pass(self, node: ast.Pass) -> None:
        pass

    def _on_Return(self, node: ast.Return) -> None:
        value = Known(None) if node.value is None else self.value(node.value)
        assert self.block is not None
        self._returns.append((self.block, {RETURNED: value}))
        self.block = None

    def _on_Break(self, node: ast.Break) -> None:
        assert self.block is not None
        self._loops[-1].breaks.append((self.block, self.names))
        self.block = None

    def _on_Continue(self, node: ast.Continue) -> None:
        assert self.block is not None
        self._loops[-1].continues.append((self.block, self.names))
        self.block = None

    def assign(self, target: ast.expr, value: Value) -> None:
        """Bind a name, several names, or an element of an array."""
        if isinstance(target, ast.Name):
            self.names[target.id] = value
        elif isinstance(target, ast.Tuple):
            parts = value.items if isinstance(value, Group) else self._unpacked(value)
            if len(parts) != len(target.elts):
                raise Unsupported(f"{len(parts)} values for {len(target.elts)} names")
            for part, inner in zip(parts, target.elts, strict=True):
                self.assign(inner, part)
        elif isinstance(target, ast.Subscript):
            array, places = self.value(target.value), self._places(target.slice)
            if not isinstance(array, View):
                raise Unsupported("only elements of arrays can be assigned to")
            if any(isinstance(p, tuple) for p in places) or len(places) < array.type.axes:
                self.fill(self.cut(array, places), value)
            else:
                self.store(array, places, value)  # type: ignore[arg-type]
        else:
            raise Unsupported(f"{type(target).__name__} cannot be assigned to")

    def _unpacked(self, value: Value) -> Sequence[Value]:
        raise Unsupported("only a tuple can be taken apart")

    def _on_If(self, node: ast.If) -> None:
        condition = self.condition(node.test)
        if condition.literal is not None:
            self.statements(node.body if condition.literal else node.orelse)
            return
        yes, no = self.fork(condition.text)
        before, edges = self.names, []
        for block, body in ((yes, node.body), (no, node.orelse)):
            self.block, self.names = block, dict(before)
            self.statements(body)
            if self.block is not None:
                edges.append((self.block, self.names))
        self.names = self.join(edges)

    # ------------------------------------------------------------------ loops

    def _on_While(self, node: ast.While) -> None:
        if node.orelse:
            raise Unsupported("else after a loop")
        self._loop(node, lambda: self.condition(node.test), None, node.body)

    def _on_For(self, node: ast.For) -> None:
        call = node.iter
        if node.orelse:
            raise Unsupported("else after a loop")
        is_range = isinstance(call, ast.Call) and self._thing(call.func) is range
        if not is_range:
            group = self.value(node.iter)
            if not isinstance(group, Group):
                raise Unsupported("a loop runs over a range or a tuple")
            self._written_out(node, group.items)
            return
        assert isinstance(call, ast.Call)
        parts = [self.value(a) for a in call.args]
        if not all(isinstance(p, Scalar) and p.type.whole for p in parts):
            raise Unsupported("a range takes integers")
        mark, names = self._mark(), dict(self.names)
        try:
            self._ranged(node, parts)  # type: ignore[arg-type]
        except LiteralNeeded:
            ends = [p.literal for p in parts]  # type: ignore[union-attr]
            if None in ends or len(range(*ends)) > MOST_WRITTEN:
                raise
            self._reset(mark)
            self.names = names
            items = tuple(literal(k, INT, bare=True) for k in range(*ends))
            self._written_out(node, items)

    def _ranged(self, node: ast.For, parts: Sequence[Scalar]) -> None:
        if not isinstance(node.target, ast.Name):
            raise Unsupported("a loop over a range has one name")
        target = node.target.id
        first, last, step = self._range(parts)
        counter = f"{target} of {node.lineno}:{node.col_offset}"
        before = self.names
        self.names = {**before, counter: first}

        def goes_on() -> Scalar:
            at = self.names[counter]
            assert isinstance(at, Scalar)
            return self.compare("Lt" if step > 0 else "Gt", at, last)

        def enter() -> None:
            self.names[target] = self.names[counter]

        def following() -> None:
            at = self.names[counter]
            assert isinstance(at, Scalar)
            wraps = "nsw" if at.type.kind == "i" else "nuw" if step > 0 else ""
            self.names[counter] = Scalar(at.type, self.do(f"add {wraps} i64 {at.text}, {step}"))

        self._loop(node, goes_on, following, node.body, enter, (counter,))
        self.names.pop(counter, None)

    def _range(self, parts: Sequence[Scalar]) -> tuple[Scalar, Scalar, int]:
        """First, last (not reached) and step of a range, of one type of 64 bits."""
        first, last = (literal(0, INT, True), parts[0]) if len(parts) == 1 else parts[:2]
        step = 1
        if len(parts) == 3:
            if parts[2].literal in (None, 0):
                raise Unsupported("the step of a range is a literal")
            step = int(parts[2].literal)
        kind = UINT if step > 0 and self.together(first, last) == UINT else INT
        return Scalar(kind, self.cast(first, kind).text), self.cast(last, kind), step

    def _written_out(self, node: ast.For, items: Sequence[Value]) -> None:
        """A loop over known items: its body once for each."""
        loop = _Loop()
        self._loops.append(loop)
        for item in items:
            if self.block is None:
                break
            self.assign(node.target, item)
            self.statements(node.body)
            edges = loop.continues + ([(self.block, self.names)] if self.block else [])
            loop.continues = []
            self.names = self.join(edges)
        self._loops.pop()
        edges = loop.breaks + ([(self.block, self.names)] if self.block else [])
        self.names = self.join(edges)

    def _loop(
        self,
        node: ast.For | ast.While,
        goes_on: Callable[[], Scalar],
        following: Callable[[], None] | None,
        body: Sequence[ast.stmt],
        enter: Callable[[], None] | None = None,
        hidden: tuple[str, ...] = (),
    ) -> None:
        """A loop while `goes_on` says so; written until the types of its names stay."""
        assert self.block is not None
        assigned = [*self.source.assigned(node), *hidden]
        before, mark = self.names, self._mark()
        kinds: dict[str, Type] = {}
        for name in assigned:
            if name in before and not isinstance(before[name], Known):
                kinds[name] = type_of(before[name])
        while True:
            changed = self._turn(before, kinds, goes_on, following, body, enter, node)
            if changed is None:
                return
            kinds = changed
            self._reset(mark)
            self.names = before

    def _mark(self) -> tuple[Block, tuple[int, ...]]:
        """A place to which what is written can be taken back."""
        assert self.block is not None
        lists = (self.blocks, self.block.lines, self._returns, self._heap, self._loops)
        return self.block, tuple(map(len, lists))

    def _reset(self, mark: tuple[Block, tuple[int, ...]]) -> None:
        block, lengths = mark
        lists = (self.blocks, block.lines, self._returns, self._heap, self._loops)
        for written, length in zip(lists, lengths, strict=True):
            del written[length:]
        self.block = block

    def _turn(
        self,
        before: Names,
        kinds: dict[str, Type],
        goes_on: Callable[[], Scalar],
        following: Callable[[], None] | None,
        body: Sequence[ast.stmt],
        enter: Callable[[], None] | None,
        node: ast.For | ast.While,
    ) -> dict[str, Type] | None:
        """Write the loop once; returns other types of its names if these do not hold."""
        entrance = self.block
        assert entrance is not None
        values: dict[str, list[str]] = {}
        for name, kind in kinds.items():
            if name in before:
                values[name] = registers(self.converted(before[name], kind))
            else:
                values[name] = [zero(t) for t in register_types(kind)]
        top = self.new_block()
        self.jump(top)
        self.block = top
        phis = {name: [self.register() for _ in parts] for name, parts in values.items()}
        first_line = len(top.lines)
        self.names = {
            **before,
            **{n: of_registers(k, phis[n]) for n, k in kinds.items()},
        }
        loop = _Loop()
        self._loops.append(loop)
        condition = goes_on()
        names = self.names
        exits: list[Edge] = []
        if condition.literal is None:
            inside, outside = self.fork(condition.text)
            exits.append((outside, dict(names)))
            self.block = inside
        elif not condition.literal:
            exits.append((self.block, dict(names)))
            self.block = None
        self.names = dict(names)
        if self.block is not None and enter is not None:
            enter()
        self.statements(body)
        edges = loop.continues + ([(self.block, self.names)] if self.block else [])
        self.names = self.join(edges)
        if self.block is not None and following is not None:
            following()
        self._loops.pop()
        lines = []
        if self.block is not None:
            wanted = self._wanted(kinds, before, node)
            if wanted != kinds:
                return wanted
            latch = self.block
            ends = {n: registers(self.converted(self.names[n], k)) for n, k in kinds.items()}
            self.jump(top)
            for name, kind in kinds.items():
                for k, llvm in enumerate(register_types(kind)):
                    ways = f"[ {values[name][k]}, %{entrance.label} ]"
                    ways += f", [ {ends[name][k]}, %{latch.label} ]"
                    lines.append(f"{phis[name][k]} = phi {llvm} {ways}")
        else:  # Never repeated: the phis have one way in.
            for name, kind in kinds.items():
                for k, llvm in enumerate(register_types(kind)):
                    way = f"[ {values[name][k]}, %{entrance.label} ]"
                    lines.append(f"{phis[name][k]} = phi {llvm} {way}")
        top.lines[first_line:first_line] = lines
        self.names = self.join(exits + loop.breaks)
        return None

    def _wanted(
        self, kinds: dict[str, Type], before: Names, node: ast.For | ast.While
    ) -> dict[str, Type]:
        """Types that the loop's names have at its entrance or at its end."""
        wanted = {}
        for name, kind in kinds.items():
            end = self.names[name]
            start = before.get(name)
            if isinstance(start, Scalar) and start.bare and kind == start.type:
                found = common_type([start, end])
                if found is None:
                    raise Unsupported(f"{name} changes its type in a loop")
                wanted[name] = found
            else:
                wanted[name] = joined(kind, type_of(end))
        for name in self.source.outliving(node):
            if name in self.names and name not in before and name not in wanted:
                wanted[name] = type_of(self.names[name])
        return wanted

    # ------------------------------------------------------------------ expressions

    def condition(self, node: ast.expr) -> Scalar:
        """An expression as a truth value."""
        return self.truth(self.value(node))

    def value(self, node: ast.expr) -> Value:
        """The value of an expression."""
        handler = getattr(self, f"_of_{type(node).__name__}", None)
        if handler is None:
            raise Unsupported(f"{type(node).__name__} is not an expression of kernels")
        found: Value = handler(node)
        return found

    def _of_Constant(self, node: ast.Constant) -> Value:
        return constant(node.value)

    def _of_Name(self, node: ast.Name) -> Value:
        if node.id in self.names:
            return self.names[node.id]
        if node.id in self.source.local:
            raise Unsupported(f'"{node.id}" may be used before it has a value')
        if node.id in self.source.scope:
            return constant(self.source.scope[node.id])
        if hasattr(builtins, node.id):
            return Known(getattr(builtins, node.id))
        raise Unsupported(f'name "{node.id}" is not known')

    def _thing(self, node: ast.expr) -> Any:
        value = self.value(node)
        return value.thing if isinstance(value, Known) else value

    def _of_Tuple(self, node: ast.Tuple) -> Value:
        return Group(tuple(self.value(item) for item in node.elts))

    def _of_Attribute(self, node: ast.Attribute) -> Value:
        base = self.value(node.value)
        if isinstance(base, Known):
            if not hasattr(base.thing, node.attr):
                raise Unsupported(f"{base.thing!r} has no {node.attr}")
            return constant(getattr(base.thing, node.attr))
        if isinstance(base, Group) and node.attr in base.names:
            return base.items[base.names.index(node.attr)]
        if isinstance(base, View) and node.attr in ("size", "shape", "ndim", "dtype"):
            return self._of_array(base, node.attr)
        raise Unsupported(f"{type_of(base)} has no {node.attr}")

    def _of_array(self, array: View, name: str) -> Value:
        if name == "shape":
            return Group(tuple(Scalar(INT, extent) for extent in array.shape))
        if name == "ndim":
            return literal(array.type.axes, INT, bare=True)
        if name == "dtype":
            return Known(np.dtype(array.type.item.name))
        size = array.shape[0]
        for extent in array.shape[1:]:
            size = self.do(f"mul nsw i64 {size}, {extent}")
        return Scalar(INT, size)

    def _of_Subscript(self, node: ast.Subscript) -> Value:
        base, places = self.value(node.value), self._places(node.slice)
        if isinstance(base, Group):
            return self._part(base, places)
        if not isinstance(base, View):
            raise Unsupported("only tuples and arrays have parts")
        if len(places) > base.type.axes:
            raise Unsupported(f"{len(places)} indices for {base.type}")
        if any(isinstance(p, tuple) for p in places):
            return self.cut(base, places)
        return self.load(base, places)  # type: ignore[arg-type]

    def _part(self, group: Group, places: list[Any]) -> Value:
        if len(places) != 1:
            raise Unsupported("a tuple has one index")
        place = places[0]
        if isinstance(place, Scalar):
            return self.picked(group, place)
        ends = [p.literal if isinstance(p, Scalar) else None for p in place]
        return Group(group.items[ends[0] : ends[1]])

    def _places(self, node: ast.expr) -> list[Any]:
        """Indices as numbers, slices as pairs."""
        nodes = node.elts if isinstance(node, ast.Tuple) else [node]
        places: list[Any] = []
        for part in nodes:
            if isinstance(part, ast.Slice):
                if part.step is not None:
                    raise Unsupported("a slice has no step")
                ends = (part.lower, part.upper)
                places.append(tuple(Known(None) if e is None else self.value(e) for e in ends))
                continue
            place = self.value(part)
            if isinstance(place, Group):
                places += place.items
            elif isinstance(place, Scalar) and place.type.whole:
                places.append(place)
            else:
                raise Unsupported("an index is an integer")
        return places

    def _of_BinOp(self, node: ast.BinOp) -> Value:
        left = self.value(node.left)
        return self.binary(type(node.op).__name__, left, self.value(node.right))

    def _of_UnaryOp(self, node: ast.UnaryOp) -> Value:
        value = self.value(node.operand)
        if isinstance(node.op, ast.Not):
            truth = self.truth(value)
            if truth.literal is not None:
                return literal(not truth.literal, BOOL)
            return Scalar(BOOL, self.do(f"xor i1 {truth.text}, true"))
        if not isinstance(value, Scalar):
            raise Unsupported("a sign belongs to a number")
        if isinstance(node.op, ast.USub):
            return self.negative(value)
        if isinstance(node.op, ast.Invert):
            kind = value.type
            text = f"xor {kind.llvm} {value.text}, {'true' if kind.kind == 'b' else -1}"
            return Scalar(kind, self.do(text))
        return value

    def _of_Compare(self, node: ast.Compare) -> Value:
        left, result = self.value(node.left), literal(True, BOOL)
        for op, other in zip(node.ops, node.comparators, strict=True):
            right = self.value(other)
            result = self._both(result, self._compared(op, left, right))
            left = right
        return result

    def _both(self, a: Scalar, b: Scalar) -> Scalar:
        if a.literal is not None:
            return b if a.literal else a
        return Scalar(BOOL, self.do(f"and i1 {a.text}, {b.text}"))

    def _compared(self, op: ast.cmpop, left: Value, right: Value) -> Scalar:
        if isinstance(op, ast.Is | ast.IsNot):
            same = isinstance(left, Known) and isinstance(right, Known)
            same = same and left.thing is right.thing  # type: ignore[union-attr]
            return literal(same == isinstance(op, ast.Is), BOOL)
        if isinstance(op, ast.In | ast.NotIn) and isinstance(right, Group):
            found = literal(False, BOOL)
            for item in right.items:
                test = self._compared(ast.Eq(), left, item)
                found = self.truth(self.binary("BitOr", found, test))
            return found if isinstance(op, ast.In) else Scalar(
                BOOL, self.do(f"xor i1 {found.text}, true")
            )  # fmt: skip
        if isinstance(left, Known) and isinstance(right, Known):
            return literal((left.thing == right.thing) == isinstance(op, ast.Eq), BOOL)
        if not isinstance(left, Scalar) or not isinstance(right, Scalar):
            raise Unsupported("only numbers are compared")
        return self.compare(type(op).__name__, left, right)

    def _of_BoolOp(self, node: ast.BoolOp) -> Value:
        """`and`, `or`: the rest is looked at only where it matters, unless it is cheap."""
        ends = isinstance(node.op, ast.Or)
        result = self.condition(node.values[0])
        shortcuts: list[Edge] = []
        for part in node.values[1:]:
            if result.literal is not None:
                if result.literal == ends:
                    break
                result = self.condition(part)
                continue
            if self.source.cheap(part):
                step = "or" if ends else "and"
                other = self.condition(part)
                result = Scalar(BOOL, self.do(f"{step} i1 {result.text}, {other.text}"))
                continue
            yes, no = self.fork(result.text)
            leave, self.block = (yes, no) if ends else (no, yes)
            shortcuts.append((leave, {RETURNED: literal(ends, BOOL)}))
            result = self.condition(part)
        if not shortcuts:
            return result
        assert self.block is not None
        shortcuts.append((self.block, {RETURNED: result}))
        return self.join(shortcuts)[RETURNED]

    def _of_IfExp(self, node: ast.IfExp) -> Value:
        condition = self.condition(node.test)
        if condition.literal is not None:
            return self.value(node.body if condition.literal else node.orelse)
        if self.source.cheap(node.body) and self.source.cheap(node.orelse):
            yes, no = self.value(node.body), self.value(node.orelse)
            picked = self.chosen(condition, yes, no)
            if picked is None:
                raise Unsupported("the two values of a choice have types that do not fit")
            return picked
        edges: list[Edge] = []
        for block, part in zip(self.fork(condition.text), (node.body, node.orelse), strict=True):
            self.block = block
            value = self.value(part)
            assert self.block is not None
            edges.append((self.block, {RETURNED: value}))
        found = self.join(edges)
        if RETURNED not in found:
            raise Unsupported("the two values of a choice have types that do not fit")
        return found[RETURNED]

    def _of_Call(self, node: ast.Call) -> Value:
        if node.keywords:
            raise Unsupported("arguments without keywords")
        if isinstance(node.func, ast.Attribute) and node.func.attr == "view":
            base = self.value(node.func.value)
            if isinstance(base, Scalar):
                kind = self._thing(node.args[0])
                from motes.machine.types import of_dtype

                return self.bits_as(base, of_dtype(np.dtype(kind)))
        thing = self.value(node.func)
        if not isinstance(thing, Known):
            raise Unsupported("only functions are called")
        arguments: list[Value] = []
        for a in node.args:
            if isinstance(a, ast.Starred):
                group = self.value(a.value)
                if not isinstance(group, Group):
                    raise Unsupported("only a tuple can be spread over arguments")
                arguments += group.items
            else:
                arguments.append(self.value(a))
        return self.call(thing.thing, arguments)


def returned(kind: Type) -> str:
    """LLVM's type of what a function returns."""
    kinds = register_types(kind)
    if not kinds:
        return "void"
    return kinds[0] if len(kinds) == 1 else f"{{ {', '.join(kinds)} }}"


__all__ = ["DOUBLE", "Block", "Function"]
