"""Machine code: kernels compiled when they are called first, a private cache of them, threads.

Every compiled function of the project goes through `jit`. Kernels are serial and release the
interpreter lock; `share` runs one call per block of rows on a few threads. That leaves Ctrl-C and
progress working between blocks, and makes it impossible for a result to depend on the number of
threads, as long as no two blocks write to the same element.

The compiler is `motes.machine`. What is outside its language goes to Numba (`numba_jit`), which
takes some thirty times as long and is only loaded when it is needed.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import threading
from collections.abc import Callable, Sequence
from functools import cache, partial, update_wrapper
from pathlib import Path
from typing import Any

from motes.errors import OutputError, SceneError
from motes.files import written_whole
from motes.pool import (
    BRIEF,
    available_processors,
    blocks,
    even_blocks,
    share,
    share_out,
    threads,
)  # fmt: skip

__all__ = [
    "BRIEF", "EXACT", "FAST", "STRICT", "Calls", "Kernel", "available_processors", "blocks",
    "bound", "cache_folder", "each", "even_blocks", "jit", "listen", "share", "threads",
]  # fmt: skip

FAST = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Reorders and fuses arithmetic, but NaN and infinity stay honest (no nnan, no ninf)."""

EXACT = frozenset({"contract"})
"""Fused multiply-add only: for code whose order of operations carries its accuracy."""

STRICT: frozenset[str] = frozenset()
"""IEEE 754 to the letter: the same bits on any processor of one architecture."""


def jit(
    function: Callable[..., Any] | None = None,
    *,
    flags: frozenset[str] = FAST,
    inline: bool = False,
    numba: bool = True,
) -> Any:
    """Compile a function to a serial kernel without the interpreter lock, kept in the kernel cache.

    `inline=True` is for functions called from kernels: they are inlined into every caller, which
    is what lets a loop over them become SIMD, and cannot be called from Python. With
    `numba=False`, what is outside our compiler's language raises SceneError instead of going to
    Numba. With the environment variable NUMBA_DISABLE_JIT=1 functions stay what they are.
    """
    if function is None:
        return lambda f: jit(f, flags=flags, inline=inline, numba=numba)
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return function
    return Kernel(function, flags, inline, numba)


class Kernel:
    """A function with machine code for each list of argument types that it was called with."""

    def __init__(
        self,
        function: Callable[..., Any],
        flags: frozenset[str] = FAST,
        inline: bool = False,
        numba: bool = True,
    ) -> None:
        update_wrapper(self, function)
        self.py_func, self.flags, self.inline = function, flags, inline
        self._numba = numba
        self._doors: dict[tuple[Any, ...], Any] = {}
        self._lock = threading.Lock()
        self._dispatcher: Any = None

    def __repr__(self) -> str:
        return f"<kernel {self.py_func.__module__}.{self.py_func.__name__}>"

    @property
    def dispatcher(self) -> Any:
        """The function as Numba compiles it, for kernels that are outside our compiler's language,
        and for users' compiled functions that call this one."""
        if self._dispatcher is None:
            from motes.numba_jit import dispatcher

            self._dispatcher = dispatcher(self.py_func, self.flags, self.inline)
        return self._dispatcher

    def __call__(self, *arguments: Any) -> Any:
        """Run; the first call with arguments of new types compiles, or loads what was compiled."""
        from motes.machine.door import spread

        key: list[Any] = []
        numbers: list[Any] = []
        for argument in arguments:
            spread(argument, key, numbers)
        door = self.door(tuple(key), arguments)
        return door(numbers) if door is not self else self.dispatcher(*arguments)

    def bind(self, *arguments: Any) -> Callable[..., Any]:
        """The kernel with its first arguments given, so that many calls take them apart once."""
        from motes.machine.door import PLAIN, spread

        head: list[Any] = []
        given: list[Any] = []
        for argument in arguments:
            spread(argument, head, given)
        known: dict[tuple[type, ...], Callable[..., Any]] = {}

        def bound(*rest: Any) -> Any:
            key = tuple(map(type, rest))
            call = known.get(key)
            if call is not None:
                return call(*rest)
            found, numbers = head.copy(), given.copy()
            for argument in rest:
                spread(argument, found, numbers)
            whole = tuple(found)
            door = self.door(whole, (*arguments, *rest))
            if door is self:
                return self.dispatcher(*arguments, *rest)
            if not PLAIN.issuperset(key):
                return door(numbers)
            call = known[key] = door.given(given)
            return call(*rest)

        return bound

    def each(self, head: Sequence[Any], calls: Calls) -> None:
        """Call with `(*head, *tail)` for every tail, on the threads, which take the next one each
        without asking Python; no two calls may write one element."""
        from motes.machine.door import spread

        tails = calls.tails
        if len(tails) < 2:
            for tail in tails:
                self(*head, *tail)
            return
        key: list[Any] = []
        numbers: list[Any] = []
        for argument in head:
            spread(argument, key, numbers)
        last, lasts = calls.spread()
        whole = (*key, *last)
        door = self.door(whole, (*head, *tails[0]))
        run = None if door is self else door.each(numbers, lasts)
        if run is None:
            share(lambda k: self(*head, *tails[k]), len(tails))
        else:
            share_out(run, len(tails))

    def door(self, key: tuple[Any, ...], arguments: Sequence[Any]) -> Any:
        """The door for arguments of these types; the kernel itself where Numba must compile it."""
        return self._doors.get(key) or self._open(key, arguments)

    def _open(self, key: tuple[Any, ...], arguments: Sequence[Any]) -> Any:
        from motes.machine.door import kind_of
        from motes.machine.kinds import Unsupported

        name = self.py_func.__name__
        if self.inline:
            raise TypeError(
                f"{name} is inlined into kernels and has no code that Python could call; "
                f"{name}.py_func is the plain function"
            )
        with self._lock:
            if key not in self._doors:
                try:
                    self._doors[key] = _made(self, tuple(map(kind_of, arguments)))
                except Unsupported as fault:
                    if not self._numba:
                        raise SceneError(f"kernel {name}: {fault.whole()}") from fault
                    self._doors[key] = self
            return self._doors[key]

    @property
    def foreign(self) -> bool:
        """Whether Numba compiled it, for any types so far."""
        return self in self._doors.values()

    def llvm(self, *arguments: Any) -> str:
        """LLVM's text of the optimised machine code for arguments like these."""
        from motes.machine.door import kind_of
        from motes.machine.module import compiled_text
        from motes.machine.target import optimised

        return str(optimised(compiled_text(self, tuple(map(kind_of, arguments)))[0]))


def bound(kernel: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """`kernel` with its first arguments given; many calls then take them apart only once."""
    return kernel.bind(*arguments) if isinstance(kernel, Kernel) else partial(kernel, *arguments)


class Calls:
    """The last arguments of many calls of a kernel, of the same types in all of them.

    Where they are arrays and plain numbers, and whoever makes them knows that their types are
    `alike`, only the first are looked at.
    """

    def __init__(self, tails: Sequence[Sequence[Any]], alike: bool = False) -> None:
        self.tails, self._alike = tails, alike
        self._spread: tuple[list[Any], list[list[Any]]] | None = None

    def spread(self) -> tuple[list[Any], list[list[Any]]]:
        """What the arguments' types follow from, and their numbers for every call."""
        from motes.machine.door import numbers_of, spread

        if self._spread is None:
            first: list[Any] = []
            lasts: list[list[Any]] = []
            if self._alike and self.tails:
                for argument in self.tails[0]:
                    spread(argument, first, [])
                lasts = list(map(numbers_of, self.tails))
            for tail in self.tails[len(lasts) :]:
                key: list[Any] = []
                lasts.append([])
                for argument in tail:
                    spread(argument, key, lasts[-1])
                first = first or key
                if key != first:
                    raise TypeError("all calls must have arguments of the same types")
            self._spread = first, lasts
        return self._spread


def each(kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Sequence[Any]]) -> None:
    """Call a kernel that returns nothing with `(*head, *tail)` for every tail, on the threads."""
    calls = tails if isinstance(tails, Calls) else Calls(tails)
    if isinstance(kernel, Kernel):
        kernel.each(head, calls)
    else:
        share(lambda k: kernel(*head, *calls.tails[k]), len(calls.tails))


# ---------------------------------------------------------------------------- kernel cache


def _made(kernel: Kernel, kinds: tuple[Any, ...]) -> Any:
    """The door to a kernel, from the cache or the compiler.

    One file per kernel and argument types, named by a hash of everything that shaped it: its code,
    the functions and constants that it uses, flags, types, processor, LLVM, and the compiler. So an
    entry is never stale, and two writers of one name write the same thing.
    """
    from motes.machine.door import Door
    from motes.machine.fingerprint import fingerprint
    from motes.machine.target import identity, loaded

    name = kernel.py_func.__name__
    text = repr((identity(), _compiler(), sorted(kernel.flags), kinds, fingerprint(kernel.py_func)))
    path = cache_folder() / "kernels" / f"{name}-{hashlib.sha256(text.encode()).hexdigest()[:32]}"
    kept = _kept(path)
    if kept is None:
        if _listener is not None:
            _listener(name)
        kept = _compiled(kernel, kinds)
        _keep(path, kept)
    result, code = pickle.loads(kept)
    return Door(loaded(code), kinds, result)


def _compiled(kernel: Kernel, kinds: tuple[Any, ...]) -> bytes:
    """Result type and object code of a kernel."""
    from motes.machine.module import compiled_text
    from motes.machine.target import object_code

    # Many objects that live until it is done: to look for garbage among them takes time.
    collects = gc.isenabled()
    gc.disable()
    try:
        text, result = compiled_text(kernel, kinds)
    finally:
        if collects:
            gc.enable()
    return pickle.dumps((result, object_code(text)))


@cache
def _compiler() -> str:
    """A hash of the compiler itself, and of the formulas that it knows."""
    here = Path(__file__).parent
    files = sorted([*(here / "machine").glob("*.py"), *(here / "kernel").glob("*.py")])
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def _kept(path: Path) -> bytes | None:
    """What a file of the cache holds, None if it is not there or damaged."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    body, checksum = content[:-32], content[-32:]
    return body if hashlib.sha256(body).digest() == checksum else None


def _keep(path: Path, body: bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with written_whole(path, lasting=False) as file:  # A disk takes its time; see `_kept`.
            file.write(body + hashlib.sha256(body).digest())
    except (OSError, OutputError):
        pass  # A full or read-only disk costs the next start some time, nothing else.


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
