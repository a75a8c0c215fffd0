"""Machine code: Numba's compiler with our flags, a private kernel cache, and a thread pool.

Every compiled function of the project goes through `jit`. Kernels are serial and release the
interpreter lock; `share` runs one call per block of rows on a few threads. That compiles in a third
of the time of Numba's own parallel loops, leaves Ctrl-C and progress working between blocks, and
makes it impossible for a result to depend on the number of threads, as long as no two blocks write
to the same element.
"""

# mypy: disallow-subclassing-any=False
from __future__ import annotations

import gc
import hashlib
import os
import pickle
import platform
import types
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding
import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher
from numba.extending import _Intrinsic

from motes.errors import OutputError
from motes.files import written_whole
from motes.inlining import InlineCompiler, Inlined

FAST = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Reorders and fuses arithmetic, but NaN and infinity stay honest (no nnan, no ninf)."""

EXACT = frozenset({"contract"})
"""Fused multiply-add only: for code whose order of operations carries its accuracy."""

STRICT: frozenset[str] = frozenset()
"""IEEE 754 to the letter: the same bits on any processor of one architecture."""


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


def jit(
    function: Callable[..., Any] | None = None,
    *,
    flags: frozenset[str] = FAST,
    inline: bool = False,
) -> Any:
    """Compile a function to a serial kernel without the interpreter lock, kept in the kernel cache.

    `inline=True` is for functions called from kernels: they are inlined into every caller, which
    is what lets a loop over them become SIMD, and are not cached by themselves.
    """
    if function is None:
        return lambda f: jit(f, flags=flags, inline=inline)
    extra = {"pipeline_class": InlineCompiler} if inline else {}
    compiled = numba.njit(
        nogil=True,
        fastmath=set(flags) if flags else False,
        error_model="numpy",
        forceinline=inline,
        no_cfunc_wrapper=True,
        no_cpython_wrapper=inline,
        **extra,
    )(function)
    if numba.config.DISABLE_JIT:
        return compiled
    if inline:
        compiled.__class__ = Inlined
    else:
        compiled.__class__ = _Kernel
        compiled._cache = _KernelCache(function, ",".join(sorted(flags)))
    return compiled


class _Kernel(CPUDispatcher):
    """A compiled function that Python calls."""

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, or load that from the cache.

        The compiler makes millions of objects that live until it is done; looking for garbage
        among them takes a tenth of its time.
        """
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile(signature)
        finally:
            if collects:
                gc.enable()


# ---------------------------------------------------------------------------- threads

_threads = 0
_pool: ThreadPoolExecutor | None = None


def threads(count: int | None = None) -> int:
    """Number of threads that kernels use; with `count`, set it first (0: one per processor).

    The environment variable MOTES_THREADS sets the first value. Results never depend on it.
    """
    global _threads, _pool
    if count is None and not _threads:
        try:
            count = int(os.environ.get("MOTES_THREADS", "0"))
        except ValueError:
            count = 0
    if count is not None:
        if count < 0:
            raise ValueError(f"threads must be 0 (one per processor) or more, not {count}")
        _threads = count or available_processors()
        if _pool is not None:
            _pool.shutdown()
            _pool = None
    return _threads


def available_processors() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def share(task: Callable[[int], Any], count: int) -> None:
    """Run `task(0) ... task(count - 1)` on the threads; the first exception is raised again here.

    The calling thread works too, so that a short call costs little. An interrupt (Ctrl-C) drops the
    tasks that have not begun and waits for the running ones, each of which should take at most
    about 100 ms.
    """
    global _pool
    if count <= 1 or threads() == 1:
        for number in range(count):
            task(number)
        return
    if _pool is None:
        _pool = ThreadPoolExecutor(threads(), "motes")
    numbers = iter(range(count))  # Each thread takes the next one.

    def work() -> None:
        for number in numbers:
            task(number)

    helpers = [_pool.submit(work) for _ in range(min(threads(), count) - 1)]
    try:
        work()
        for helper in helpers:
            helper.result()
    except BaseException:
        for _ in numbers:
            pass
        wait(helpers)
        raise


def blocks(rows: int, size: int) -> list[tuple[int, int]]:
    """Half-open ranges of at most `size` rows that cover `rows`."""
    return [(low, min(low + size, rows)) for low in range(0, rows, size)]


# ---------------------------------------------------------------------------- kernel cache


def cache_folder() -> Path:
    """Where compiled kernels are kept: MOTES_CACHE, or the user's cache folder."""
    if chosen := os.environ.get("MOTES_CACHE"):
        return Path(chosen)
    from platformdirs import user_cache_path

    return user_cache_path("motes", appauthor=False)


_listener: Callable[[str], None] | None = None


def listen(listener: Callable[[str], None] | None) -> None:
    """Call `listener` with a kernel's name each time that one is not in the cache, or nobody."""
    global _listener
    _listener = listener


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
        return str(cache_folder() / "kernels")

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
                _fingerprint(self._py_func),
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
        if _listener is not None:
            _listener(self._py_func.__name__)
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


def _fingerprint(function: Callable[..., Any], seen: frozenset[int] = frozenset()) -> str:
    """Hash of a function's code and of all functions and constants that it reaches."""
    if id(function) in seen:
        return "recursion"
    seen = seen | {id(function)}
    known = _plain_fingerprint.get(id(function))
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
    _plain_fingerprint[id(function)] = (function, result)
    return result


_plain_fingerprint: dict[int, tuple[Callable[..., Any], str]] = {}


def _describe(value: Any, names: tuple[str, ...], seen: frozenset[int]) -> str:
    """What a global means for the code that uses it."""
    if isinstance(value, Dispatcher):
        flags = sorted(value.targetoptions.get("fastmath") or ())
        return _fingerprint(value.py_func, seen) + repr(flags)
    if isinstance(value, types.FunctionType):
        return _fingerprint(value, seen)
    if isinstance(value, _Intrinsic):
        return _fingerprint(value._defn, seen)
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
