"""Numba, for functions that are outside the language of `motes.machine`.

Those are compiled functions of users (right-hand sides for `motes.ode`), and kernels that need
Numba's own means. It is told what our kernels are, so that such functions may call them.
"""

# mypy: disallow-subclassing-any=False
from __future__ import annotations

import gc
import hashlib
import pickle
import platform
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.registry import CPUDispatcher
from numba.extending import typeof_impl

from motes import jit
from motes.errors import OutputError
from motes.files import written_whole
from motes.inlining import InlineCompiler, Inlined
from motes.machine.fingerprint import fingerprint


def _use_full_vectors() -> None:
    """Let AVX-512 processors use all of their registers.

    LLVM prefers half of them on some, from the days when full ones lowered the clock; our loops
    gain up to half again. Numba's own setting, NUMBA_CPU_FEATURES, comes first.
    """
    if numba.config.CPU_FEATURES is None and numba.config.CPU_NAME is None:
        features = llvmlite.binding.get_host_cpu_features()
        if features.get("avx512f"):
            numba.config.CPU_FEATURES = features.flatten() + ",-prefer-256-bit"


_use_full_vectors()


def dispatcher(function: Callable[..., Any], flags: frozenset[str], inline: bool) -> Any:
    """A function as Numba compiles it, with our flags and our kernel cache."""
    extra = {"pipeline_class": InlineCompiler} if inline else {}
    compiled = numba.njit(
        nogil=True,
        fastmath=set(flags) if flags else False,
        error_model="numpy",
        forceinline=inline,
        _nrt=False,
        no_cfunc_wrapper=True,
        no_cpython_wrapper=inline,
        **extra,
    )(function)
    if inline:
        compiled.__class__ = Inlined
    else:
        compiled.__class__ = _Compiled
        compiled._cache = _KernelCache(function, ",".join(sorted(flags)))
    return compiled


@typeof_impl.register(jit.Kernel)
def _type_of_kernel(kernel: Any, context: Any) -> Any:
    """A kernel that Numba meets is a function that it compiles itself."""
    return numba.types.Dispatcher(kernel.dispatcher)


class _Compiled(CPUDispatcher):
    """A compiled function that Python calls."""

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, or load that from the cache, without a look for garbage."""
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile(signature)
        finally:
            if collects:
                gc.enable()


class _KernelCache(FunctionCache):
    """One file per compiled function, named by a hash of everything that shaped it.

    Numba's own cache shares an index between writers and sees only the file that defines a
    function, not what it calls. Here the name covers the function's code, the functions and
    constants that it uses, flags, argument types, processor and Numba version: an entry is never
    stale, and two writers of one name write the same thing.
    """

    def __init__(self, function: Callable[..., Any], flags: str) -> None:
        self._py_func = function
        self._flags = flags
        self._name = repr(function)
        self._impl = _Impl(function)
        self._enabled = True

    @property
    def cache_path(self) -> str:
        return str(jit.cache_folder() / "kernels")

    def flush(self) -> None:
        """Entries are never stale."""

    def _file(self, signature: Any, codegen: Any) -> Path:
        text = repr(
            (
                numba.__version__,
                platform.python_version(),
                self._flags,
                str(signature),
                codegen.magic_tuple(),
                fingerprint(self._py_func),
            )
        )
        name = f"{self._py_func.__name__}-{hashlib.sha256(text.encode()).hexdigest()[:32]}"
        return Path(self.cache_path) / name

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            content = self._file(sig, target_context.codegen()).read_bytes()
        except OSError:
            content = b""
        body, checksum = content[:-32], content[-32:]
        if hashlib.sha256(body).digest() == checksum:
            try:
                return self._impl.rebuild(target_context, pickle.loads(body))
            except Exception:
                pass  # Whatever is wrong with a kept kernel, compiling it again is right.
        if jit._listener is not None:
            jit._listener(self._py_func.__name__)
        return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        if not self._impl.check_cachable(data):
            return
        path = self._file(sig, data.codegen)
        body = numba.core.serialize.dumps(self._impl.reduce(data))
        try:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with written_whole(path) as file:
                file.write(body + hashlib.sha256(body).digest())
        except (OSError, OutputError):
            pass  # A full or read-only disk costs the next start some seconds, nothing else.


class _Impl(CompileResultCacheImpl):
    """Numba's serialisation of compiled functions, without its search for a folder."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func = function
        self._lineno = function.__code__.co_firstlineno
        self._locator = types.SimpleNamespace(_py_file=function.__code__.co_filename)
