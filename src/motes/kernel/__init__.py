"""The kernel language: scalar functions that one compiler turns into machine code.

A `@kernel` function takes and returns scalars and tuples. It may use arithmetic, comparisons,
conditional expressions, bare literals (which take the scene's precision), other kernels, and the
elementary functions of this module. It says nothing of loops over particles, of arrays, of
precision. Called from Python it runs as it is written, on the reference functions.

There are two numeric modes: fast, in which sums may be reordered and fused (`jit.FAST`), and strict
(`jit.STRICT`), which gives the same bits on any processor of one architecture.
"""

from __future__ import annotations

import dis
import types
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np

from motes.kernel import elementary_double, elementary_single

__all__ = [
    "ELEMENTARY",
    "Elementary",
    "atan2",
    "cos",
    "damped_time",
    "exp",
    "floor",
    "int32",
    "kernel",
    "log",
    "phi1",
    "pow",
    "real",
    "sin",
    "sqrt",
    "tanh",
    "uint32",
]

Function = TypeVar("Function", bound=Callable[..., Any])

uint32 = np.uint32
int32 = np.int32


def kernel(function: Function) -> Function:
    """Mark a function as written in the kernel language."""
    function.__motes_kernel__ = True  # type: ignore[attr-defined]
    function.py_func = function  # type: ignore[attr-defined]
    return function


@dataclass(frozen=True)
class Elementary:
    """A function of the kernel language with one formula for each precision.

    `single` and `double` are formulas on float32 and float64 scalars. `reference` is what a call
    from Python computes.
    """

    name: str
    reference: Callable[..., Any]
    single: Callable[..., Any]
    double: Callable[..., Any]

    def __call__(self, *arguments: Any) -> Any:
        """Value by the reference function."""
        return self.reference(*arguments)

    def compiled(self, precision: str, flags: frozenset[str] | None = None) -> Any:
        """The formula as machine code to be inlined, for precision "single" or "double".

        `flags` are `jit.EXACT` unless given.
        """
        from motes.jit import EXACT

        formula: Callable[..., Any] = {"single": self.single, "double": self.double}[precision]
        return _compiled(formula, EXACT if flags is None else flags)


@cache
def _compiled(formula: Callable[..., Any], flags: frozenset[str]) -> Any:
    """Compile a formula together with the formulas of its module that it calls."""
    from motes.jit import jit

    scope = dict(formula.__globals__)
    for step in dis.get_instructions(formula):
        if step.opname == "LOAD_GLOBAL" and isinstance(scope.get(step.argval), types.FunctionType):
            scope[step.argval] = _compiled(scope[step.argval], flags)
    bound = types.FunctionType(formula.__code__, scope, formula.__name__)
    bound.__module__ = formula.__module__
    return jit(bound, flags=flags, inline=True)


def _phi1(z: Any) -> Any:
    z = np.asarray(z)
    return np.divide(-np.expm1(-z), z, out=np.ones_like(z, dtype=float), where=z != 0)[()]


def _both(name: str, reference: Callable[..., Any]) -> Elementary:
    return Elementary(
        name, reference, getattr(elementary_single, name), getattr(elementary_double, name)
    )


exp = _both("exp", np.exp)
log = _both("log", np.log)
sin = _both("sin", np.sin)
cos = _both("cos", np.cos)
tanh = _both("tanh", np.tanh)
atan2 = _both("atan2", np.arctan2)
pow = _both("pow", np.power)
phi1 = _both("phi1", _phi1)
damped_time = _both("damped_time", lambda rate, h: h * _phi1(rate * h))
sqrt = _both("sqrt", np.sqrt)
floor = _both("floor", np.floor)
real = _both("real", np.float64)

ELEMENTARY = {
    function.name: function
    for function in (exp, log, sin, cos, tanh, atan2, pow, phi1, damped_time, sqrt, floor, real)
}
"""The elementary functions by name."""
