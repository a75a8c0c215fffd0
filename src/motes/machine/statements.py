"""Statements without loops."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass, field

from motes.machine.block import Edge, literal
from motes.machine.kinds import INT, Unsupported
from motes.machine.syntax import RETURNED, Expressions
from motes.machine.values import Group, Known, Scalar, Value, View

LEAVES = (ast.Return, ast.Break, ast.Continue)
"""What cannot be done for some lanes only; nor can a write into an array."""


@dataclass
class Loop:
    """Where `break` and `continue` of a loop go."""

    breaks: list[Edge] = field(default_factory=list)
    continues: list[Edge] = field(default_factory=list)


class Statements(Expressions):
    """Walks over statements, one method for each kind of node."""

    _returns: list[Edge]
    _loops: list[Loop]

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
            fault.place = fault.place or self.source.place(node)
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
                old = self.load(array, places)
                new = self.binary(type(node.op).__name__, old, self.value(node.value))
                self.store(array, places, new)
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
            parts = self._unpacked(value, len(target.elts))
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
                self.store(array, places, value)
        else:
            raise Unsupported(f"{type(target).__name__} cannot be assigned to")

    def _unpacked(self, value: Value, count: int) -> Sequence[Value]:
        """The items of a tuple, or the first elements of an array, which must be as many."""
        if isinstance(value, Group):
            return value.items
        if isinstance(value, View):
            return [self.load(value, [literal(k, INT)]) for k in range(count)]
        raise Unsupported("only a tuple can be taken apart")

    def _on_If(self, node: ast.If) -> None:
        condition = self.condition(node.test)
        if condition.literal is not None:
            self.statements(node.body if condition.literal else node.orelse)
            return
        if condition.type.lanes > 1:
            self._both_ways(node, condition)
            return
        yes, no = self.fork(condition.text)
        before, edges = self.names, []
        for block, body in ((yes, node.body), (no, node.orelse)):
            self.block, self.names = block, dict(before)
            self.statements(body)
            if self.block is not None:
                edges.append((self.block, self.names))
        self.names = self.join(edges)

    def _both_ways(self, node: ast.If, condition: Scalar) -> None:
        """Both ways of a condition that differs from lane to lane, and a choice of each name."""
        parts = [n for part in (*node.body, *node.orelse) for n in ast.walk(part)]
        writes = (isinstance(n, ast.Subscript) and isinstance(n.ctx, ast.Store) for n in parts)
        if any(isinstance(n, LEAVES) for n in parts) or any(writes):
            raise Unsupported("lanes go the same way: a choice of names only")
        before, found = self.names, []
        for body in (node.body, node.orelse):
            self.names = dict(before)
            self.statements(body)
            found.append(self.names)
        yes, no = found
        self.names = dict(before)
        for name in self.source.assigned(node):
            if name in yes and name in no:
                picked = self.chosen(condition, yes[name], no[name])
                if picked is None:
                    raise Unsupported(f"{name} has two types that do not fit")
                self.names[name] = picked
