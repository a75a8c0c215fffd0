"""From an author's kernel to precise text: literals, names and calls of the kernel language.

A bare `0.5` is a double in machine code and drags single-precision arithmetic with it.
`Translation` takes a kernel's source, gives every literal the scene's precision, turns whole powers
into products, and finds what the kernel calls: other kernels, elementary functions, constants. The
result is source text for one function, and the functions that it needs.
"""

from __future__ import annotations

import ast
import builtins
import types
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from motes.catalog.source import function_node
from motes.errors import SceneError
from motes.kernel import ELEMENTARY, Elementary
from motes.kernel.fold import Known, foldable, folded, returned

BUILTINS = frozenset({"min", "max", "abs", "range", "bool", "len"})
"""Python's own functions that the kernel language has."""

MENU = (
    "Kernels use arithmetic, numbers, other @kernel functions and "
    f"{', '.join(sorted(ELEMENTARY))} of motes.kernel."
)

INTEGER_CALLS = frozenset({"range", "uint32", "int32", "uint64", "int64"})
"""Calls whose literal arguments stay whole numbers."""


@dataclass
class Translation:
    """Functions of the kernel language as source text, each named once, callees first."""

    text: list[str] = field(default_factory=list)
    elementary: dict[str, Elementary] = field(default_factory=dict)
    types: dict[str, Any] = field(default_factory=dict)
    returned: dict[str, tuple[float | None, ...]] = field(default_factory=dict)
    """For each name, what the function returns: literals, None where it varies."""
    _names: dict[Any, str] = field(default_factory=dict)

    def add(self, function: Callable[..., Any], owner: str, known: Known | None = None) -> str:
        """Translate a kernel and what it calls; returns its name in the text.

        With `known`, values of fields of its first argument, it is folded for these. Raises
        SceneError where the kernel uses something outside the kernel language.
        """
        function = getattr(function, "py_func", function)
        key = function, tuple(sorted((known or {}).items()))
        if key in self._names:
            return self._names[key]
        name = f"{function.__name__}_{len(self._names)}"
        self._names[key] = name
        node = function_node(function)
        rewrite = _Rewrite(self, function, owner)
        if known:
            node = folded(node, known, rewrite.references())
        self.returned[name] = returned(node)
        node = rewrite.visit(node)
        node.name = name
        self.text.append("@inline\n" + ast.unparse(ast.fix_missing_locations(node)))
        return name


def can_fold(function: Callable[..., Any]) -> bool:
    """Whether values may be given for the fields of a kernel's first argument."""
    return foldable(function_node(function))


class _Rewrite(ast.NodeTransformer):
    """Rewrites one function's syntax tree."""

    def __init__(self, into: Translation, function: Callable[..., Any], owner: str) -> None:
        self.into, self.function, self.owner = into, function, owner
        code = function.__code__
        self.local = set(code.co_varnames) | set(code.co_cellvars)
        self.scope = dict(function.__globals__)
        if function.__closure__:
            cells = [cell.cell_contents for cell in function.__closure__]
            self.scope |= dict(zip(code.co_freevars, cells, strict=True))
        self.whole = 0

    def references(self) -> dict[str, Callable[..., Any]]:
        """Elementary functions by the names that the kernel uses, as Python computes them."""
        return {k: v.reference for k, v in self.scope.items() if isinstance(v, Elementary)}

    def fail(self, node: ast.AST, fault: str) -> SceneError:
        code = self.function.__code__
        line = code.co_firstlineno + getattr(node, "lineno", 1) - 1
        return SceneError(f"{self.owner}, kernel {code.co_name}, line {line}: {fault}")

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        """A number gets the scene's precision, unless it counts or indexes."""
        if isinstance(node.value, bool) or node.value is None or isinstance(node.value, str):
            return node
        if not isinstance(node.value, int | float):
            raise self.fail(node, f"{node.value!r} is not a number of the kernel language.")
        if self.whole and isinstance(node.value, int):
            return node
        return _real(float(node.value))

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An index stays a whole number."""
        value = self.visit(node.value)
        self.whole += 1
        index = self.visit(node.slice)
        self.whole -= 1
        return ast.Subscript(value, index, node.ctx)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """Whole powers become products; other powers call `pow`."""
        if isinstance(node.op, ast.Pow):
            exponent = node.right
            if (
                isinstance(exponent, ast.Constant)
                and isinstance(exponent.value, int)
                and 1 < exponent.value < 9
            ):
                return _product(self.visit(node.left), exponent.value)
            call = ast.Call(ast.Name("pow", ast.Load()), [node.left, node.right], [])
            self.scope["pow"] = ELEMENTARY["pow"]
            return self.visit_Call(ast.copy_location(call, node))
        if isinstance(node.op, ast.LShift | ast.RShift | ast.BitXor) or (
            isinstance(node.op, ast.BitAnd | ast.BitOr) and _has_cast(node)
        ):
            self.whole += 1
            result = self.generic_visit(node)
            self.whole -= 1
            assert isinstance(result, ast.expr)
            return result
        result = self.generic_visit(node)
        assert isinstance(result, ast.expr)
        return result

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """Calls of integer casts and ranges keep whole literals."""
        if node.keywords:
            raise self.fail(node, "write arguments without keywords.")
        if isinstance(node.func, ast.Name) and node.func.id == "float":
            self.scope["real"] = ELEMENTARY["real"]
            node = ast.Call(ast.Name("real", ast.Load()), node.args, [])
        whole = isinstance(node.func, ast.Name) and node.func.id in INTEGER_CALLS
        function = self.visit(node.func)
        self.whole += whole
        arguments = [self.visit(a) for a in node.args]
        self.whole -= whole
        return ast.Call(function, arguments, [])

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Fields of p and q stay; names inside modules are looked up."""
        if isinstance(node.value, ast.Name) and node.value.id not in self.local:
            module = self.scope.get(node.value.id)
            if isinstance(module, types.ModuleType):
                if not hasattr(module, node.attr):
                    raise self.fail(node, f"{node.value.id} has no {node.attr}.")
                return self.global_value(node, node.attr, getattr(module, node.attr))
        return ast.Attribute(self.visit(node.value), node.attr, node.ctx)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Local names stay; global ones become constants or calls."""
        if node.id in self.local or not isinstance(node.ctx, ast.Load):
            return node
        if node.id in self.scope:
            return self.global_value(node, node.id, self.scope[node.id])
        if node.id in BUILTINS and hasattr(builtins, node.id):
            return node
        raise self.fail(node, f'name "{node.id}" is not known. {MENU}')

    def global_value(self, node: ast.AST, name: str, value: Any) -> ast.expr:
        if isinstance(value, Elementary):
            self.into.elementary[f"{value.name}_"] = value
            return ast.Name(f"{value.name}_", ast.Load())
        if getattr(value, "__motes_kernel__", False):
            return ast.Name(self.into.add(value, self.owner), ast.Load())
        if isinstance(value, type) and issubclass(value, np.generic):
            self.into.types[value.__name__] = value
            return ast.Name(value.__name__, ast.Load())
        if isinstance(value, bool):
            return ast.Constant(value)
        if isinstance(value, int | float | np.integer | np.floating):
            whole = self.whole and isinstance(value, int | np.integer)
            return ast.Constant(int(value)) if whole else _real(float(value))
        if isinstance(value, tuple) and all(isinstance(v, int | float | np.number) for v in value):
            return ast.Tuple([_real(float(v)) for v in value], ast.Load())
        hint = ""
        if name in ELEMENTARY:
            hint = f" Import {name} from motes.kernel."
        raise self.fail(
            node,
            f'"{name}" cannot be used in a kernel.{hint} {MENU}',
        )


def _real(value: float) -> ast.expr:
    """The literal `F(value)`: a number of the scene's precision."""
    text = repr(value)
    if value in (float("inf"), float("-inf")) or value != value:
        return ast.Call(
            ast.Name("F", ast.Load()),
            [ast.Call(ast.Name("float", ast.Load()), [ast.Constant(text)], [])],
            [],
        )
    return ast.Call(ast.Name("F", ast.Load()), [ast.Constant(value)], [])


def _product(base: ast.expr, power: int) -> ast.expr:
    """base * base * ..., which costs nothing when the compiler shares the base."""
    result = base
    for _ in range(power - 1):
        result = ast.BinOp(result, ast.Mult(), base)
    return result


def _has_cast(node: ast.AST) -> bool:
    """Whether an expression holds an explicit integer type."""
    return any(
        isinstance(n, ast.Call) and isinstance(n.func, ast.Name) and n.func.id in INTEGER_CALLS
        for n in ast.walk(node)
    )
