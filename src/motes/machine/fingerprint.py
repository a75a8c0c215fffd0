"""A hash of a function and all that it reaches: what its machine code depends on."""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.machine.values import Written


def fingerprint(function: Callable[..., Any], seen: frozenset[int] = frozenset()) -> str:
    """Hash of a function's code and of all functions and constants that it reaches."""
    if id(function) in seen:
        return "recursion"
    seen = seen | {id(function)}
    known = _known.get(id(function))
    if known is not None and known[0] is function:
        return known[1]
    parts = [str(function.__module__)]
    scopes = [function.__globals__]
    if function.__closure__:
        names = function.__code__.co_freevars
        cells = [cell.cell_contents for cell in function.__closure__]
        scopes.insert(0, dict(zip(names, cells, strict=True)))
    for code in _code_objects(function.__code__):
        parts.append(code.co_code.hex())
        parts += [repr(c) for c in code.co_consts if not isinstance(c, types.CodeType)]
        parts += [repr(function.__defaults__), repr(code.co_names), repr(code.co_varnames)]
        for name in code.co_names + code.co_freevars:
            for scope in scopes:
                if name in scope:
                    parts.append(name + "=" + _describe(scope[name], code.co_names, seen))
                    break
    result = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    _known[id(function)] = (function, result)
    return result


_known: dict[int, tuple[Callable[..., Any], str]] = {}


def _describe(value: Any, names: tuple[str, ...], seen: frozenset[int]) -> str:
    """What a global means for the code that uses it."""
    if isinstance(getattr(value, "py_func", None), types.FunctionType):
        return fingerprint(value.py_func, seen) + repr(sorted(getattr(value, "flags", ())))
    if isinstance(value, types.FunctionType):
        return fingerprint(value, seen)
    if isinstance(value, Written):
        return fingerprint(value.formula, seen)
    if isinstance(value, np.ndarray):
        return hashlib.sha256(value.tobytes()).hexdigest() + str(value.dtype)
    if isinstance(value, types.ModuleType):
        if not value.__name__.startswith("motes"):
            return value.__name__
        inner = [name for name in names if hasattr(value, name)]
        return ",".join(name + _describe(getattr(value, name), (), seen) for name in inner)
    if isinstance(value, type) and hasattr(value, "_fields"):
        return value.__name__ + repr(value._fields)
    if isinstance(value, type) or callable(value):
        return getattr(value, "__qualname__", repr(type(value)))
    return repr(value)


@cache
def _code_objects(code: types.CodeType) -> tuple[types.CodeType, ...]:
    inner = [c for c in code.co_consts if isinstance(c, types.CodeType)]
    return (code, *(leaf for c in inner for leaf in _code_objects(c)))
