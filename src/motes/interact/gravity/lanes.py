"""Explicit SIMD for kernels: LANES numbers that travel together.

Numba makes innermost loops SIMD, but cannot keep a row of an array in a register across iterations
of an outer loop, nor estimate a root. A value of `read` or `spread` is one LLVM vector, with + - *
between two of them. Where Numba is off, lanes are NumPy arrays, and the same kernels run.
"""

# mypy: disallow-subclassing-any=False
from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model


def _widest() -> int:
    """Numbers in single precision that one register holds, at least 8."""
    return 16 if llvmlite.binding.get_host_cpu_features().get("avx512f") else 8


LANES = _widest()


class Lanes(types.Type):
    """Type of LANES numbers of one kind."""

    def __init__(self, element: Any) -> None:
        self.element = element
        super().__init__(name=f"Lanes({element}, {LANES})")


@register_model(Lanes)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, lanes: Lanes) -> None:
        element = manager.lookup(lanes.element).get_value_type()
        super().__init__(manager, lanes, ir.VectorType(element, LANES))


def _define(sign: Any, name: str) -> None:
    """Let kernels write `a sign b` for two lanes."""

    @infer_global(sign)
    class Arithmetic(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if len(args) == 2 and isinstance(args[0], Lanes) and args[0] == args[1]:
                return signature(args[0], *args)
            return None

    @lower_builtin(sign, Lanes, Lanes)
    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = isinstance(sig.return_type.element, types.Integer)
        return getattr(builder, name[1:] if whole else name)(*args)


_define(operator.add, "fadd")
_define(operator.sub, "fsub")
_define(operator.mul, "fmul")


# ---------------------------------------------------------------- code for values of LLVM


def splat(builder: Any, value: Any) -> Any:
    """A vector that holds one number LANES times."""
    vector = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    for lane in range(LANES):
        vector = builder.insert_element(vector, value, ir.Constant(ir.IntType(32), lane))
    return vector


def constant(element: Any, number: float) -> Any:
    """The same of a number that is known."""
    return ir.Constant(ir.VectorType(element, LANES), [number] * LANES)


def shuffle(builder: Any, a: Any, b: Any, places: list[int]) -> Any:
    """The numbers at some places of two vectors end to end."""
    return builder.shuffle_vector(
        a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places)
    )


def joined(builder: Any, parts: list[Any]) -> Any:
    """Vectors end to end."""
    while len(parts) > 1:
        width = parts[0].type.count
        parts = [
            shuffle(builder, a, b, list(range(2 * width)))
            for a, b in zip(parts[::2], parts[1::2], strict=True)
        ]
    return parts[0]


def added(builder: Any, vector: Any) -> Any:
    """Sum over the lanes, by halves."""
    return _by_halves(builder, vector, builder.fadd)


def _by_halves(builder: Any, vector: Any, join: Callable[[Any, Any], Any]) -> Any:
    width = vector.type.count
    while width > 1:
        width //= 2
        low, high = (list(range(k * width, (k + 1) * width)) for k in (0, 1))
        vector = join(shuffle(builder, vector, vector, low), shuffle(builder, vector, vector, high))
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


def square_root(builder: Any, vector: Any) -> Any:
    """Root of each lane."""
    suffix = "f32" if isinstance(vector.type.element, ir.FloatType) else "f64"
    kind = ir.FunctionType(vector.type, [vector.type])
    name = f"llvm.sqrt.v{vector.type.count}{suffix}"
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), [vector])


def estimate(builder: Any, vector: Any) -> Any:
    """1 / root of each lane in single precision, to 11 bits or better."""
    features = llvmlite.binding.get_host_cpu_features()
    if not features.get("avx"):
        one = constant(vector.type.element, 1.0)
        return builder.fdiv(one, square_root(builder, vector))
    eight = ir.VectorType(ir.FloatType(), 8)
    kind = ir.FunctionType(eight, [eight])
    root = cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.avx.rsqrt.ps.256")
    if LANES == 8:
        return builder.call(root, [vector])
    sixteen = vector.type
    kind = ir.FunctionType(sixteen, [sixteen, sixteen, ir.IntType(16)])
    wide = "llvm.x86.avx512.rsqrt14.ps.512"
    root = cgutils.get_or_insert_function(builder.module, kind, wide)
    every = ir.Constant(ir.IntType(16), -1)
    return builder.call(root, [vector, ir.Constant(sixteen, ir.Undefined), every])


# ---------------------------------------------------------------- what kernels call

if numba.config.DISABLE_JIT:

    def read(column: Any, first: int) -> Any:
        """LANES numbers of a contiguous column from `first` on."""
        return column[first : first + LANES].copy()

    def write(column: Any, first: int, lanes: Any) -> None:
        """Write lanes into a contiguous column from `first` on."""
        column[first : first + LANES] = lanes

    def spread(value: Any) -> Any:
        """Lanes that all hold one number."""
        return np.full(LANES, value)

    def total(lanes: Any) -> Any:
        """Sum over the lanes."""
        return lanes.sum()

    def largest(lanes: Any) -> Any:
        """Largest lane."""
        return lanes.max()

    def maximum(a: Any, b: Any) -> Any:
        """The larger of each two; b where a is not a number."""
        return np.where(a > b, a, b)

    def choose(a: Any, b: Any, one: Any, other: Any) -> Any:
        """`one` where a < b, else `other`."""
        return np.where(a < b, one, other)

    def inverse_root(lanes: Any) -> Any:
        """1 / root."""
        with np.errstate(divide="ignore"):
            return lanes.dtype.type(1) / np.sqrt(lanes)

    rough_inverse_root = inverse_root

else:

    def _place(context: Any, builder: Any, array_type: Any, array: Any, place: Any) -> Any:
        """Pointer to lanes from an element of a column on, and its sure alignment."""
        data = context.make_array(array_type)(context, builder, array).data
        element = context.get_value_type(array_type.dtype)
        pointer = builder.bitcast(
            builder.gep(data, [place]), ir.VectorType(element, LANES).as_pointer()
        )
        return pointer, context.get_abi_sizeof(element)

    @intrinsic
    def read(typing: Any, column: Any, first: Any) -> Any:
        """LANES numbers of a contiguous column from `first` on."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            pointer, align = _place(context, builder, sig.args[0], *args)
            return builder.load(pointer, align=align)

        return Lanes(column.dtype)(column, types.intp), generate

    @intrinsic
    def write(typing: Any, column: Any, first: Any, lanes: Any) -> Any:
        """Write lanes into a contiguous column from `first` on."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            pointer, align = _place(context, builder, sig.args[0], *args[:2])
            builder.store(args[2], pointer, align=align)
            return context.get_dummy_value()

        return types.void(column, types.intp, lanes), generate

    @intrinsic
    def spread(typing: Any, value: Any) -> Any:
        """Lanes that all hold one number."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return splat(builder, args[0])

        return Lanes(value)(value), generate

    @intrinsic
    def total(typing: Any, lanes: Any) -> Any:
        """Sum over the lanes."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return added(builder, args[0])

        return lanes.element(lanes), generate

    def _larger(builder: Any, a: Any, b: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", a, b), a, b)

    @intrinsic
    def largest(typing: Any, lanes: Any) -> Any:
        """Largest lane."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _by_halves(builder, args[0], lambda a, b: _larger(builder, a, b))

        return lanes.element(lanes), generate

    @intrinsic
    def maximum(typing: Any, a: Any, b: Any) -> Any:
        """The larger of each two; b where a is not a number."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return _larger(builder, *args)

        return a(a, b), generate

    @intrinsic
    def choose(typing: Any, a: Any, b: Any, one: Any, other: Any) -> Any:
        """`one` where a < b, else `other`."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[2], args[3])

        return one(a, b, one, other), generate

    @intrinsic
    def rough_inverse_root(typing: Any, lanes: Any) -> Any:
        """1 / root in single precision, to 11 bits or better."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return estimate(builder, args[0])

        return lanes(lanes), generate

    @intrinsic
    def inverse_root(typing: Any, lanes: Any) -> Any:
        """1 / root in double precision: Householder's third-order step from single's 22 bits."""

        def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            x = args[0]
            single = ir.VectorType(ir.FloatType(), LANES)
            near = builder.fptrunc(x, single)
            one = constant(ir.FloatType(), 1.0)
            y = builder.fpext(builder.fdiv(one, square_root(builder, near)), x.type)
            h = builder.fsub(constant(x.type.element, 1.0), builder.fmul(x, builder.fmul(y, y)))
            step = builder.fmul(constant(x.type.element, 0.375), h)
            step = builder.fadd(constant(x.type.element, 0.5), step)
            return builder.fadd(y, builder.fmul(builder.fmul(y, h), step))

        return lanes(lanes), generate
