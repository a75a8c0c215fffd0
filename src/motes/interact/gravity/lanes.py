"""Explicit SIMD for kernels: LANES numbers that travel together.

Numba makes innermost loops SIMD, but cannot keep a row of an array in a register across iterations
of an outer loop. These operations can: a value of `load` is one LLVM vector, which becomes one or
more registers of whatever machine it is. Rows are those of C-contiguous arrays (rows, LANES).
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model

LANES = 16

if numba.config.DISABLE_JIT:

    def load(array: Any, row: int) -> Any:
        """Row of an array as lanes."""
        return array[row].copy()

    def store(array: Any, row: int, lanes: Any) -> None:
        """Write lanes into a row of an array."""
        array[row] = lanes

    def spread(value: Any) -> Any:
        """Lanes that all hold one number."""
        return np.full(LANES, value)

    def fma(a: Any, b: Any, c: Any) -> Any:
        """Lanes a b + c."""
        return a * b + c

else:

    class Lanes(types.Type):
        """Type of LANES numbers of one kind."""

        def __init__(self, element: Any) -> None:
            self.element = element
            super().__init__(name=f"Lanes({element})")

    @register_model(Lanes)
    class _Model(models.PrimitiveModel):  # type: ignore[misc]
        def __init__(self, manager: Any, lanes: Lanes) -> None:
            element = manager.lookup(lanes.element).get_value_type()
            super().__init__(manager, lanes, ir.VectorType(element, LANES))

    def _row(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
        """Pointer to a row, and the alignment that every row has."""
        data = context.make_array(array_type)(context, builder, array).data
        offset = builder.mul(row, ir.Constant(row.type, LANES))
        element = context.get_value_type(array_type.dtype)
        pointer = builder.bitcast(
            builder.gep(data, [offset]), ir.VectorType(element, LANES).as_pointer()
        )
        return pointer, context.get_abi_sizeof(element)

    @intrinsic
    def load(typing: Any, array: Any, row: Any) -> Any:
        """Row of an array as lanes."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer, align = _row(context, builder, signature.args[0], *arguments)
            return builder.load(pointer, align=align)

        return Lanes(array.dtype)(array, types.intp), generate

    @intrinsic
    def store(typing: Any, array: Any, row: Any, lanes: Any) -> Any:
        """Write lanes into a row of an array."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer, align = _row(context, builder, signature.args[0], *arguments[:2])
            builder.store(arguments[2], pointer, align=align)
            return context.get_dummy_value()

        return types.void(array, types.intp, lanes), generate

    @intrinsic
    def spread(typing: Any, value: Any) -> Any:
        """Lanes that all hold one number."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            vector = ir.Constant(ir.VectorType(arguments[0].type, LANES), ir.Undefined)
            for lane in range(LANES):
                place = ir.Constant(ir.IntType(32), lane)
                vector = builder.insert_element(vector, arguments[0], place)
            return vector

        return Lanes(value)(value), generate

    @intrinsic
    def fma(typing: Any, a: Any, b: Any, c: Any) -> Any:
        """Lanes a b + c."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            product = builder.fmul(arguments[0], arguments[1])
            return builder.fadd(product, arguments[2])

        return a(a, b, c), generate
