"""A function's syntax tree, and what its names are."""

from __future__ import annotations

import ast
import linecache
import types
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from motes.machine.kinds import Unsupported

CHEAP = (
    ast.Name, ast.Constant, ast.BinOp, ast.UnaryOp, ast.Compare, ast.operator, ast.unaryop,
    ast.cmpop, ast.expr_context, ast.Attribute, ast.Tuple,
)  # fmt: skip
"""What may be computed although it is not needed."""

FEW = 24
"""Nodes of the largest expression that is computed although it may not be needed."""


@lru_cache(maxsize=64)
def _definitions(text: str) -> dict[tuple[str, int], ast.FunctionDef]:
    """All functions of a file by name and first line, decorators and lambdas included."""
    found: dict[tuple[str, int], ast.FunctionDef] = {}
    lambdas: dict[int, list[ast.Lambda]] = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            lines = [node.lineno, *(d.lineno for d in node.decorator_list)]
            found[node.name, min(lines)] = node
        elif isinstance(node, ast.Lambda):
            lambdas.setdefault(node.lineno, []).append(node)
    for line, nodes in lambdas.items():
        if len(nodes) == 1:  # Of several in one line, none can be told from the others.
            whole = ast.FunctionDef("lambda_", nodes[0].args, [ast.Return(nodes[0].body)], [])
            ast.copy_location(whole.body[0], nodes[0].body)
            found["<lambda>", line] = ast.copy_location(whole, nodes[0])
    return found


class Source:
    """A function as the compiler sees it."""

    _known: dict[types.FunctionType, Source] = {}  # noqa: RUF012

    def __init__(self, function: types.FunctionType) -> None:
        code = function.__code__
        text = "".join(linecache.getlines(code.co_filename, function.__globals__))
        node = _definitions(text).get((code.co_name, code.co_firstlineno)) if text else None
        if node is None:
            raise Unsupported(f"the source text of {code.co_name} cannot be read")
        arguments = node.args
        if arguments.vararg or arguments.kwarg or arguments.kwonlyargs:
            raise Unsupported(f"{code.co_name} takes arguments that are not plain")
        self.function, self.node = function, node
        self.body: Sequence[ast.stmt] = node.body
        self.parameters = [a.arg for a in (*arguments.posonlyargs, *arguments.args)]
        self.local = set(code.co_varnames) | set(code.co_cellvars)
        self.scope: dict[str, Any] = dict(function.__globals__)
        if function.__closure__:
            cells = [cell.cell_contents for cell in function.__closure__]
            self.scope |= dict(zip(code.co_freevars, cells, strict=True))
        self._assigned: dict[ast.AST, list[str]] = {}
        self._cheap: dict[ast.AST, bool] = {}
        self._loads: list[tuple[str, int]] | None = None

    @classmethod
    def of(cls, function: types.FunctionType) -> Source:
        """The source of a function, read once."""
        if function not in cls._known:
            cls._known[function] = cls(function)
        return cls._known[function]

    def place(self, node: ast.AST) -> str:
        """Where a piece of code is, for messages."""
        name = self.function.__code__.co_filename
        line = getattr(node, "lineno", self.node.lineno)
        return f'{name}:{line}, in {self.node.name}: "{ast.unparse(node).splitlines()[0][:80]}"'

    def assigned(self, node: ast.AST) -> list[str]:
        """Names that a piece of code binds, each once."""
        if node not in self._assigned:
            names = {
                n.id: None
                for n in ast.walk(node)
                if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
            }
            self._assigned[node] = list(names)
        return self._assigned[node]

    def outliving(self, node: ast.For | ast.While) -> list[str]:
        """Names that a loop binds and that are read in a line after it."""
        if self._loads is None:
            self._loads = [
                (n.id, n.lineno)
                for n in ast.walk(self.node)
                if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
            ]
        end = node.end_lineno or node.lineno
        later = {name for name, line in self._loads if line > end}
        return [name for name in self.assigned(node) if name in later]

    def cheap(self, node: ast.expr) -> bool:
        """Whether an expression may be computed although it may not be needed."""
        if node not in self._cheap:
            self._cheap[node] = self._is_cheap(node)
        return self._cheap[node]

    def _is_cheap(self, node: ast.expr) -> bool:
        parts = list(ast.walk(node))
        calls = [n for n in parts if isinstance(n, ast.Call)]
        for call in calls:
            name = call.func.id if isinstance(call.func, ast.Name) else ""
            thing = None if name in self.local else self.scope.get(name)
            if not (isinstance(thing, type) and issubclass(thing, np.generic)):
                return False
        return len(parts) <= FEW and all(isinstance(n, (*CHEAP, ast.Call)) for n in parts)
