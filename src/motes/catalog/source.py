"""A component's own source text: parameter help, kernels to rewrite, what a digest covers."""

from __future__ import annotations

import ast
import inspect
import linecache
import textwrap
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from types import FunctionType
from typing import Any

from motes.errors import SceneError


@lru_cache(maxsize=256)
def _tree(text: str) -> ast.Module:
    return ast.parse(text)


def _class_node(cls: type) -> tuple[ast.ClassDef, str] | None:
    """The class statement, found through one of the class's functions or its module's file.

    A class in a notebook cell has no file that `inspect` can find, but its functions know their
    cell.
    """
    functions = [f for f in vars(cls).values() if isinstance(f, FunctionType)]
    names = [f.__code__.co_filename for f in functions]
    with suppress(OSError, TypeError):  # A class of a notebook cell has no file.
        names.append(inspect.getfile(cls))
    for name in names:
        text = "".join(linecache.getlines(name))
        try:
            tree = _tree(text)
        except SyntaxError:
            continue
        found = [
            n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name == cls.__name__
        ]
        if found:
            return found[-1], text
    return None


def attribute_docs(cls: type) -> dict[str, str]:
    """The string under each declaration of a class body, on one line, by attribute name."""
    located = _class_node(cls)
    docs: dict[str, str] = {}
    if located is None:
        return docs
    body = located[0].body
    for statement, after in pairwise(body):
        if (
            isinstance(statement, ast.AnnAssign)
            and isinstance(statement.target, ast.Name)
            and isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
            and isinstance(after.value.value, str)
        ):
            docs[statement.target.id] = " ".join(after.value.value.split())
    return docs


def class_source(cls: type) -> str:
    """Source text of a class, or its kernels' byte code where there is no text."""
    located = _class_node(cls)
    if located is None:
        return repr({k: f.__code__.co_code for k, f in vars(cls).items() if hasattr(f, "__code__")})
    return ast.get_source_segment(located[1], located[0]) or ""


def fields_read(function: Callable[..., Any], argument: int, all_fields: Iterable[str]) -> set[str]:
    """What a kernel reads of an argument: names of fields, all where it passes it on as a whole."""
    node = function_node(getattr(function, "py_func", function))
    name = node.args.args[argument].arg
    parents = [n for n in ast.walk(node) if isinstance(n, ast.Attribute)]
    read = {n.attr for n in parents if isinstance(n.value, ast.Name) and n.value.id == name}
    inside = {id(n.value) for n in parents}
    whole = any(
        isinstance(n, ast.Name) and n.id == name and id(n) not in inside for n in ast.walk(node)
    )
    return read | (set(all_fields) if whole else set())


def function_node(function: Callable[..., Any]) -> ast.FunctionDef:
    """Syntax tree of a function, free of decorators, annotations and docstring.

    Raises SceneError for a function without source text, such as one typed at Python's own prompt.
    """
    try:
        lines, _ = inspect.getsourcelines(function)
    except OSError:
        raise SceneError(
            f"kernel {function.__qualname__}: its source text cannot be read. "
            "Write the component in a file or a notebook cell."
        ) from None
    node = ast.parse(textwrap.dedent("".join(lines))).body[0]
    assert isinstance(node, ast.FunctionDef)
    node.decorator_list = []
    node.returns = None
    for argument in node.args.args:
        argument.annotation = None
    if ast.get_docstring(node) is not None:
        node.body = node.body[1:]
    return node
