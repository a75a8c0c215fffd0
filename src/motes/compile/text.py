"""The generated text of a system: its components fused into functions of one particle.

What the text defines, in this order: elementary functions and kernels; `scene` (values at a time);
`rate` or `kick` and `drift` (the right-hand side); `advance` (one step of one particle, written out
from the method's table); `straight` (the SIMD loop). Loops that are not hot live in plain Python
files beside this one and call these functions.
"""

from __future__ import annotations

import hashlib
from collections import namedtuple
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from motes.catalog import Component
from motes.compile.values import Values
from motes.control.constant import Constant, Setting
from motes.control.curve import TABLE_SIZE
from motes.generated import executed
from motes.jit import FAST, STRICT, jit
from motes.kernel import ELEMENTARY
from motes.kernel.language import Translation, can_fold
from motes.linear import factorise, implicit_matrix, substitute
from motes.machine.lanes import streams

AXES = ("x", "y", "z")
STATE = ("x", "y", "z", "vx", "vy", "vz")


@dataclass(frozen=True)
class Call:
    """A call of a kernel in generated text, and what it is known to give."""

    source: str
    gives: tuple[float | None, ...]
    """Literals, None where it varies; empty where nothing is known."""

    def always_zero(self, i: int) -> bool:
        """Whether the i-th number is always 0, and need not be added."""
        return i < len(self.gives) and self.gives[i] == 0


@dataclass
class Text:
    """Collects the source of one generated module and turns it into functions."""

    precision: str
    strict: bool = False
    values: Values = field(default_factory=Values)
    translation: Translation = field(default_factory=Translation)
    records: dict[str, Any] = field(default_factory=dict)
    parts: list[str] = field(default_factory=list)

    @property
    def real(self) -> Any:
        """The floating-point type of the module."""
        return np.float32 if self.precision == "single" else np.float64

    def call(
        self,
        component: Component,
        address: str,
        name: str,
        arguments: str,
        entry: Callable[[str], str] | None = None,
    ) -> Call:
        """Translate a component's kernel and write a call to it, with its parameters first.

        `entry` writes one parameter, where it is not simply registered as a value.
        """
        function = component.kernel(name)
        assert function is not None
        known = _known(component) if can_fold(function) else {}
        written = [k for k in component.parameters if k in component.own and k not in known]
        owner = f'{component.kind.noun} "{component.type}"'
        kernel = self.translation.add(function, owner, known)

        def registered(key: str) -> str:
            return packed(self.values.add(component.values[key], f"{address}.{key}"))

        fields = {key: (entry or registered)(key) for key in written}
        p = self.record("P", fields or {"nothing": "F(0.0)"})
        return Call(f"{kernel}({p}, {arguments})", self.translation.returned[kernel])

    def record(self, name: str, fields: dict[str, str]) -> str:
        """An expression that builds a named tuple with the given expressions as fields."""
        names = tuple(fields)
        kind = f"{name}_{hashlib.sha1(','.join(names).encode()).hexdigest()[:6]}"
        self.records[kind] = namedtuple(kind, names)
        return f"{kind}({', '.join(fields.values())})"

    def add(self, source: str) -> None:
        """Append a function's source."""
        self.parts.append(source)

    def module(self, extra: dict[str, Any] | None = None) -> dict[str, Any]:
        """Compile the collected text lazily: its functions by name.

        Kernels that do not depend on a change keep their machine code: the kernel cache names each
        by its own text and that of the functions it calls.
        """
        source = "\n\n".join([*self.translation.text, *self.parts])
        flags = STRICT if self.strict else FAST
        scope: dict[str, Any] = {
            "__name__": __name__,  # Cached machine code is rebuilt in an importable module.
            "F": self.real,
            "uint8": np.uint8,
            "bits": np.int32 if self.precision == "single" else np.int64,
            "SIGN": np.int32(31) if self.precision == "single" else np.int64(63),
            "empty": np.empty,
            "streams": streams,
            "implicit_matrix": implicit_matrix,
            "factorise": factorise,
            "substitute": substitute,
            "inline": lambda f: jit(f, flags=flags, inline=True),
            "kernel": lambda f: jit(f, flags=flags, numba=False),
            "lookup": _lookup(self.real, flags),
            **self.translation.types,
            **self.records,
            **(extra or {}),
        }
        exact = STRICT if self.strict else None
        for name, function in self.translation.elementary.items():
            scope[name] = function.compiled(self.precision, exact)
        for name in ("damped_time", "sqrt", "sin", "cos"):
            scope[name] = ELEMENTARY[name].compiled(self.precision, exact)
        if self.values.splines:
            from motes.control.spline_kernels import spline_at

            scope["spline_at"] = spline_at
        return executed(source, scope)


def _known(component: Component) -> dict[str, tuple[float, ...]]:
    """Own parameters that become part of the machine code: settings, and what has its default."""
    found: dict[str, tuple[float, ...]] = {}
    for key in component.own:
        control, parameter = component.values[key], component.parameters[key]
        if isinstance(control, Setting):
            if isinstance(control.value, int | float):
                found[key] = (float(control.value),)
        elif isinstance(control, Constant) and control == parameter.control(parameter.default):
            found[key] = tuple(float(v) for v in control.values)
    return found


def packed(expressions: Sequence[str]) -> str:
    """One expression, or a tuple of several."""
    return expressions[0] if len(expressions) == 1 else f"({', '.join(expressions)})"


@cache
def _lookup(real: Any, flags: frozenset[str]) -> Any:
    """Linear interpolation in a row of the lookup tables; `place` runs from 0 to 1."""
    zero, one, last = real(0), real(1), real(TABLE_SIZE - 1)
    top = np.int32(TABLE_SIZE - 2)

    def lookup(tables, row, place):  # type: ignore[no-untyped-def]
        u = min(max(place, zero), one) * last
        left = min(np.int32(u), top)
        weight = u - real(left)
        index = np.uint32(left)  # Unsigned: a signed index would be tested for a negative value.
        low, high = tables[row, index], tables[row, index + np.uint32(1)]
        return low + weight * (high - low)

    return jit(lookup, flags=flags, inline=True)
