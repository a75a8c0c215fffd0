"""Loops: written with the types that names have at the entrance, again where the end has others."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

from motes.machine.block import Block, Edge, Names, common_type, literal, zero
from motes.machine.kinds import INT, UINT, LiteralNeeded, Type, Unsupported, joined
from motes.machine.statements import Loop, Statements
from motes.machine.values import (
    Group,
    Known,
    Scalar,
    Value,
    of_registers,
    register_types,
    registers,
    type_of,
)

MOST_WRITTEN = 64
"""Turns of the longest loop that is written out."""


class Loops(Statements):
    """Walks over loops."""

    _heap: list[str]

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
        loop = Loop()
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

    def _mark(self) -> tuple[Block, list[int]]:
        """A place to which what is written can be taken back."""
        assert self.block is not None
        return self.block, [len(part) for part in self._written(self.block)]

    def _reset(self, mark: tuple[Block, list[int]]) -> None:
        block, lengths = mark
        for part, length in zip(self._written(block), lengths, strict=True):
            del part[length:]
        self.block = block

    def _written(self, block: Block) -> list[list[Any]]:
        return [self.blocks, block.lines, self._returns, self._heap, self._loops]

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
        loop = Loop()
        self._loops.append(loop)
        condition = goes_on()
        if condition.type.lanes > 1:
            raise Unsupported("a loop ends for all lanes at once")
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
