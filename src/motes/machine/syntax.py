"""Expressions of Python's syntax tree as values."""

from __future__ import annotations

import ast
import builtins
from typing import Any

import numpy as np

from motes.machine.block import Edge, Names, literal
from motes.machine.calls import Calls
from motes.machine.kinds import BOOL, INT, Unsupported, of_dtype
from motes.machine.source import Source
from motes.machine.values import Group, Known, Scalar, Value, View, type_of

RETURNED = "return"
"""A name that Python cannot have: of what a function returns, or a choice gives."""


class Expressions(Calls):
    """Walks over expressions; `names` is what local names stand for."""

    source: Source
    names: Names

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
        return self.constant(node.value)

    def _of_Name(self, node: ast.Name) -> Value:
        if node.id in self.names:
            return self.names[node.id]
        if node.id in self.source.local:
            raise Unsupported(f'"{node.id}" may be used before it has a value')
        if node.id in self.source.scope:
            return self.constant(self.source.scope[node.id])
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
            return self.constant(getattr(base.thing, node.attr))
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
        return Scalar(INT, self.product(array.shape))

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
        return self.load(base, places)

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
                return literal(not truth.literal, truth.type)
            return self.binary("BitXor", truth, literal(True, BOOL))
        if not isinstance(value, Scalar):
            raise Unsupported("a sign belongs to a number")
        if isinstance(node.op, ast.USub):
            return self.negative(value)
        if isinstance(node.op, ast.Invert):
            kind = value.type
            ones = literal(True if kind.kind == "b" else -1, kind).text
            return Scalar(kind, self.do(f"xor {kind.llvm} {value.text}, {ones}"))
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
        return self.truth(self.binary("BitAnd", a, b))

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
            if isinstance(op, ast.In):
                return found
            return self.truth(self.binary("BitXor", found, literal(True, BOOL)))
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
            if self.source.cheap(part) or result.type.lanes > 1:
                step = "BitOr" if ends else "BitAnd"
                result = self.truth(self.binary(step, result, self.condition(part)))
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
        cheap = self.source.cheap(node.body) and self.source.cheap(node.orelse)
        if cheap or condition.type.lanes > 1:
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
        if isinstance(node.func, ast.Attribute):
            base, name = self.value(node.func.value), node.func.attr
            if isinstance(base, Scalar) and name == "view":
                kind = self._thing(node.args[0])
                return self.bits_as(base, of_dtype(np.dtype(kind)))
            if isinstance(base, View) and name in ("reshape", "ravel"):
                extents = [self.value(a) for a in node.args] or [literal(-1, INT)]
                return self.reshaped(base, extents)
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
