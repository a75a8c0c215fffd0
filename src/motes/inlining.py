"""How a function that exists only inside kernels is compiled: to LLVM's text, and no further.

Numba makes each function it meets into machine code that can be called from Python. What is always
inlined needs neither, and leaving that out saves a fifth of a kernel's time to compile.
"""

# mypy: disallow-subclassing-any=False, disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering, NopythonRewrites
from numba.core.untyped_passes import (
    InlineClosureLikes,
    InlineInlinables,
    LiteralUnroll,
    WithLifting,
)


class Inlined(CPUDispatcher):
    """A compiled function that has no code of its own."""

    def __call__(self, *arguments: Any) -> Any:
        """Raise TypeError: only kernels can call it."""
        raise TypeError(
            f"{self.py_func.__name__} is inlined into kernels and has no code that Python could "
            f"call; {self.py_func.__name__}.py_func is the plain function"
        )


class InlineCompiler(CompilerBase):
    """Numba's compiler without passes for what such functions never use."""

    UNUSED = (WithLifting, InlineClosureLikes, InlineInlinables, LiteralUnroll, NopythonRewrites)

    def define_pipelines(self) -> list[Any]:
        """The one pipeline."""
        manager = PassManager("inlined")
        for step, description in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if step is NativeLowering:
                manager.add_pass(_Lowering, description)
            elif step not in self.UNUSED:
                manager.add_pass(step, description)
        manager.finalize()
        return [manager]


class _Library(JITCodeLibrary):
    """Code that is only ever linked into other code: not optimised by itself, no machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_specific(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """Lowering into a library of that kind."""

    _name = "inlined_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower the function."""
        context = state.targetctx
        state.library = _Library(context.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        result = state["cr"]
        # Callers find the function by an object which elsewhere is its machine code, and which must
        # be a built-in function: any bound method of a fresh object is a unique one.
        key = object().__reduce__
        context.insert_user_function(key, result.fndesc, [state.library])
        state["cr"] = result._replace(cfunc=key)
        return True
