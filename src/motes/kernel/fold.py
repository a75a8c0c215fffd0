"""Partial evaluation: a kernel's syntax tree with some parameters known.

What a scene leaves at its default should cost nothing, but machine-code optimisers may not drop
0 * x while infinities stay honest. The kernel language is pure, so the syntax tree can be folded
here: known parameters become literals, and what follows from them is computed (0 * x = 0,
x + 0 = x, 1 * x = x, x - x = 0, functions of literals, branches on literals). A name is followed
when it is assigned once, outside branches and loops.
"""

from __future__ import annotations

import ast
import copy
import math
import operator
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Known = Mapping[str, tuple[float, ...]]
"""Values of parameters: `p.name` is a number, or a tuple if there are several."""

ARITHMETIC: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}

COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}

BUILTIN_CALLS: dict[str, Callable[..., Any]] = {"min": min, "max": max, "abs": abs}


def foldable(node: ast.FunctionDef) -> bool:
    """Whether a function uses its first argument only as `p.name`."""
    if not node.args.args:
        return False
    p = node.args.args[0].arg
    uses = sum(isinstance(n, ast.Name) and n.id == p for n in ast.walk(node))
    fields = sum(
        isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id == p
        for n in ast.walk(node)
    )
    return uses == fields


def folded(
    node: ast.FunctionDef, known: Known, functions: Mapping[str, Callable[..., Any]]
) -> ast.FunctionDef:
    """The function for known values of its first argument's fields.

    `functions` gives the reference of each elementary function by the name that the source uses.
    """
    return _Fold(node, known, functions).function()


def returned(node: ast.FunctionDef) -> tuple[float | None, ...]:
    """What a function with one return statement gives: literals, and None where it varies."""
    returns = [n.value for n in ast.walk(node) if isinstance(n, ast.Return)]
    if len(returns) != 1 or returns[0] is None:
        return ()
    value = returns[0]
    return tuple(_number(v) for v in (value.elts if isinstance(value, ast.Tuple) else [value]))


class _Fold(ast.NodeTransformer):
    """Folds one function."""

    def __init__(
        self, node: ast.FunctionDef, known: Known, functions: Mapping[str, Callable[..., Any]]
    ) -> None:
        self.node, self.known = node, known
        self.functions = {**BUILTIN_CALLS, **functions}
        self.first = node.args.args[0].arg
        stored = [n for n in ast.walk(node) if isinstance(n, ast.Name) and _is_stored(n)]
        self.assigned = Counter(n.id for n in stored)
        self.depth = 0
        self.values: dict[str, ast.expr] = {}

    def function(self) -> ast.FunctionDef:
        self.node.body = self._block(self.node.body)
        while self._drop_unread():
            pass
        return self.node

    def _block(self, body: list[ast.stmt]) -> list[ast.stmt]:
        result: list[ast.stmt] = []
        for statement in body:
            if isinstance(statement, ast.Assign):
                for single in _separate(statement):
                    result += self._assign(single)
            elif isinstance(statement, ast.If):
                result += self._branch(statement)
            elif isinstance(statement, ast.For | ast.While):
                self.depth += 1
                for expression in ("iter", "test"):
                    if hasattr(statement, expression):
                        setattr(statement, expression, self.visit(getattr(statement, expression)))
                statement.body = self._block(statement.body)
                statement.orelse = self._block(statement.orelse)
                self.depth -= 1
                result.append(statement)
            else:
                result.append(self.visit(statement))
        return result

    def _assign(self, node: ast.Assign) -> list[ast.stmt]:
        node.value = self.visit(node.value)
        target = node.targets[0]
        if len(node.targets) == 1 and isinstance(target, ast.Name) and not self.depth:
            single = self.assigned[target.id] == 1 and target.id not in self._arguments()
            if single and self._lasting(node.value):
                self.values[target.id] = node.value
        return [node]

    def _branch(self, node: ast.If) -> list[ast.stmt]:
        test = self.visit(node.test)
        if isinstance(test, ast.Constant):
            return self._block(node.body if test.value else node.orelse)
        self.depth += 1
        node.test, node.body, node.orelse = test, self._block(node.body), self._block(node.orelse)
        self.depth -= 1
        return [node]

    def _arguments(self) -> set[str]:
        return {a.arg for a in self.node.args.args}

    def _lasting(self, value: ast.expr) -> bool:
        """Whether an expression is a literal or a name that never gets another value."""
        if isinstance(value, ast.Tuple):
            return all(self._lasting(v) for v in value.elts)
        if isinstance(value, ast.UnaryOp | ast.Attribute):
            return self._lasting(value.operand if isinstance(value, ast.UnaryOp) else value.value)
        if isinstance(value, ast.Name):
            return self.assigned[value.id] + (value.id in self._arguments()) == 1
        return _number(value) is not None

    def _drop_unread(self) -> bool:
        """Take out assignments to names that nothing reads; kernels have no side effects."""
        names = [n for n in ast.walk(self.node) if isinstance(n, ast.Name)]
        read = {n.id for n in names if not _is_stored(n)}

        def needed(statement: ast.stmt) -> bool:
            return not isinstance(statement, ast.Assign) or any(
                not isinstance(t, ast.Name) or t.id in read
                for target in statement.targets
                for t in (target.elts if isinstance(target, ast.Tuple) else [target])
            )

        before = len(self.node.body)
        self.node.body = [s for s in self.node.body if needed(s)]
        return len(self.node.body) < before

    def visit_Name(self, node: ast.Name) -> ast.expr:
        # A copy: what comes next rewrites trees in place.
        return node if _is_stored(node) else copy.deepcopy(self.values.get(node.id, node))

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if isinstance(node.value, ast.Name) and node.value.id == self.first:
            values = self.known.get(node.attr)
            if values is not None:
                literals: list[ast.expr] = [_literal(v) for v in values]
                return literals[0] if len(literals) == 1 else ast.Tuple(literals, ast.Load())
        return self._generic(node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        result = self._generic(node)
        assert isinstance(result, ast.Subscript)
        index = _number(result.slice)
        if isinstance(result.value, ast.Tuple) and isinstance(index, int):
            return result.value.elts[index]
        return result

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.expr:
        operand = self.visit(node.operand)
        if isinstance(node.op, ast.USub):
            return _negative(operand)
        if isinstance(node.op, ast.Not) and isinstance(operand, ast.Constant):
            return ast.Constant(not operand.value)
        return ast.UnaryOp(node.op, operand)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        a, b = self.visit(node.left), self.visit(node.right)
        return _simpler(a, node.op, b) or ast.BinOp(a, node.op, b)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        result = self._generic(node)
        assert isinstance(result, ast.Compare)
        left, right = _number(result.left), _number(result.comparators[0])
        compare = COMPARISONS.get(type(result.ops[0]))
        if compare is None or left is None or right is None or len(result.ops) > 1:
            return result
        return ast.Constant(bool(compare(left, right)))

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        test = self.visit(node.test)
        if isinstance(test, ast.Constant):
            return self._visited(node.body if test.value else node.orelse)
        return ast.IfExp(test, self.visit(node.body), self.visit(node.orelse))

    def visit_Call(self, node: ast.Call) -> ast.expr:
        arguments = [self._visited(a) for a in node.args]
        numbers = [_number(a) for a in arguments]
        if isinstance(node.func, ast.Name) and None not in numbers and numbers:
            function = self.functions.get(node.func.id)
            value = _computed(function, *numbers) if function is not None else None
            if value is not None:
                return _literal(value)
        return ast.Call(node.func, arguments, node.keywords)

    def _visited(self, node: ast.expr) -> ast.expr:
        result = self.visit(node)
        assert isinstance(result, ast.expr)
        return result

    def _generic(self, node: ast.expr) -> ast.expr:
        result = self.generic_visit(node)
        assert isinstance(result, ast.expr)
        return result


def _is_stored(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _separate(node: ast.Assign) -> list[ast.Assign]:
    """`a, b = x, y` as two statements, where neither right side reads a left one."""
    target, value = node.targets[0], node.value
    if (
        len(node.targets) > 1
        or not isinstance(target, ast.Tuple)
        or not isinstance(value, ast.Tuple)
        or len(target.elts) != len(value.elts)
    ):
        return [node]
    written = {n.id for n in ast.walk(target) if isinstance(n, ast.Name)}
    if any(isinstance(n, ast.Name) and n.id in written for n in ast.walk(value)):
        return [node]
    return [ast.Assign([t], v) for t, v in zip(target.elts, value.elts, strict=True)]


def _number(node: ast.expr) -> float | None:
    """Value of a literal."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _number(node.operand)
        return None if value is None else -value
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return None if isinstance(node.value, bool) else node.value
    return None


def _literal(value: float) -> ast.expr:
    return ast.Constant(value) if value >= 0 else ast.UnaryOp(ast.USub(), ast.Constant(-value))


def _negative(node: ast.expr) -> ast.expr:
    value = _number(node)
    if value is not None:
        return _literal(-value if value else value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return node.operand
    return ast.UnaryOp(ast.USub(), node)


def _computed(function: Callable[..., Any], *arguments: Any) -> float | None:
    """A function's finite value, or None."""
    try:
        with np.errstate(all="ignore"):
            value = function(*arguments)
        value = value if isinstance(value, int) else float(value)
    except (ArithmeticError, ValueError, TypeError):
        return None
    return value if math.isfinite(value) else None


def _same(a: ast.expr, b: ast.expr) -> bool:
    return ast.dump(a) == ast.dump(b)


def _simpler(a: ast.expr, op: ast.operator, b: ast.expr) -> ast.expr | None:
    """An operation in simpler form, or None."""
    left, right = _number(a), _number(b)
    if left is not None and right is not None and type(op) in ARITHMETIC:
        value = _computed(ARITHMETIC[type(op)], left, right)
        return None if value is None else _literal(value)
    if isinstance(op, ast.Add):
        return b if left == 0 else a if right == 0 else None
    if isinstance(op, ast.Sub):
        return _difference(a, b, left, right)
    if isinstance(op, ast.Mult):
        for number, other in ((left, b), (right, a)):
            if number in (0, 1, -1):
                return [ast.Constant(0.0), other, _negative(other)][int(number)]
    if isinstance(op, ast.Div) and (left == 0 or right == 1):
        return a
    return a if isinstance(op, ast.Pow) and right == 1 else None


def _difference(
    a: ast.expr, b: ast.expr, left: float | None, right: float | None
) -> ast.expr | None:
    if right == 0:
        return a
    if left == 0:
        return _negative(b)
    if _same(a, b):
        return ast.Constant(0.0)
    if isinstance(a, ast.BinOp) and isinstance(a.op, ast.Add) and _same(a.right, b):
        return a.left
    return None
