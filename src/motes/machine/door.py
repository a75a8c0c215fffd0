"""How Python calls machine code: arguments as numbers of 8 bytes in a row."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from motes.machine.kinds import (
    BOOL,
    DOUBLE,
    INT,
    NOTHING,
    Array,
    Number,
    Tuple,
    Type,
    Unsupported,
    of_dtype,
)
from motes.pool import share_out

_PROTOTYPE = ctypes.CFUNCTYPE(None, ctypes.c_char_p, ctypes.c_void_p)
"""Calls through it release the interpreter's lock."""


_EACH = ctypes.CFUNCTYPE(
    None, ctypes.c_char_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64
)

PLAIN = frozenset({int, float, *(np.dtype(letter).type for letter in "bBhHiIlLqQfd")})
"""Types of arguments that go to machine code as the numbers that they are."""


def spread(argument: Any, key: list[Any], numbers: list[Any]) -> None:
    """Append what an argument's type follows from, and its numbers.

    Every call goes through it, so that it takes arrays and numbers, the usual arguments, first.
    """
    kind = type(argument)
    if kind is np.ndarray:
        key += (argument.dtype, argument.ndim, argument.flags.c_contiguous)
        numbers.append(id(argument))
    elif kind in PLAIN:
        key.append(kind)
        numbers.append(argument)
    elif isinstance(argument, tuple):
        known = _apart.get(id(argument)) or _taken_apart(argument)
        key.append(known[1])
        numbers += known[2]
    elif kind is bool or kind is np.bool_:
        key.append(bool)
        numbers.append(int(argument))
    elif argument is None:
        key.append(None)
    else:
        key.append(kind)
        numbers.append(argument)


def numbers_of(arguments: Sequence[Any]) -> list[Any]:
    """What `spread` gives as numbers of arguments that are arrays and plain numbers."""
    return [id(one) if type(one) is np.ndarray else one for one in arguments]


SMALL = 1 << 16
"""Bytes of arrays below which a tuple of them is remembered."""

_Apart = tuple[tuple[Any, ...], tuple[Any, ...], list[Any]]
_apart: dict[int, _Apart] = {}
"""Tuples that came, by their identity, with their key and numbers: the constants of kernels, which
come with every call. They are kept so that no other tuple takes their place, so only small ones."""


def _taken_apart(argument: tuple[Any, ...]) -> _Apart:
    key: list[Any] = [type(argument)]
    numbers: list[Any] = []
    for item in argument:
        spread(item, key, numbers)
    known = argument, tuple(key), numbers
    sizes = [item.nbytes if type(item) is np.ndarray else SMALL for item in argument]
    if sum(sizes) < SMALL:
        if len(_apart) >= 256:
            _apart.clear()
        _apart[id(argument)] = known
    return known


def kind_of(argument: Any) -> Type:
    """The type of an argument. Raises Unsupported for what kernels do not take."""
    if isinstance(argument, np.ndarray):
        return Array(of_dtype(argument.dtype), argument.ndim, argument.flags.c_contiguous)
    if isinstance(argument, bool | np.bool_):
        return BOOL
    if isinstance(argument, np.generic):
        return of_dtype(argument.dtype)
    if isinstance(argument, int):
        return INT
    if isinstance(argument, float):
        return DOUBLE
    if isinstance(argument, tuple):
        return Tuple(tuple(map(kind_of, argument)), tuple(getattr(argument, "_fields", ())))
    if argument is None:
        return NOTHING
    raise Unsupported(f"{type(argument).__name__} is not taken by kernels")


def letters(kind: Type) -> str:
    """How `struct` packs a type's registers."""
    if isinstance(kind, Number):
        return "d" if kind.kind == "f" else "Q" if kind.kind == "u" else "q"
    if isinstance(kind, Tuple):
        return "".join(map(letters, kind.items))
    if isinstance(kind, Array):
        return "Q"
    return ""


def _taker(kind: Type) -> Callable[[list[Any]], Any]:
    """A function that takes a result of a type from unpacked numbers."""
    if isinstance(kind, Tuple):
        parts = [_taker(item) for item in kind.items]
        return lambda numbers: tuple(part(numbers) for part in parts)
    if isinstance(kind, Number):
        if kind == BOOL:
            return lambda numbers: bool(numbers.pop() & 1)
        return lambda numbers: numbers.pop()
    if kind == NOTHING:
        return lambda numbers: None
    raise Unsupported("a kernel cannot return an array to Python")


class Door:
    """Machine code for one list of argument types."""

    def __init__(self, addresses: tuple[int, int], kinds: Sequence[Type], result: Type) -> None:
        self.address = addresses[0]
        self._function = _PROTOTYPE(addresses[0])
        self._each = _EACH(addresses[1]) if addresses[1] else None
        self._letters = "".join(map(letters, kinds))
        self._pack = struct.Struct("=" + self._letters).pack
        self._result = result
        out = letters(result)
        self._unpack = struct.Struct("=" + out).unpack
        self._size = 8 * len(out)
        self._take = _taker(result)

    def __call__(self, numbers: Sequence[Any]) -> Any:
        """Call with the numbers of all arguments."""
        if not self._size:
            self._function(self._pack(*numbers), None)
            return None
        room = ctypes.create_string_buffer(self._size)
        self._function(self._pack(*numbers), room)
        found = list(self._unpack(room.raw))
        found.reverse()
        return self._take(found)

    def given(self, numbers: Sequence[Any]) -> Callable[..., Any]:
        """Calls with the first numbers given, which are packed only once."""
        if self._size:
            return lambda *rest: self((*numbers, *rest))
        function, count = self._function, len(numbers)
        packed = struct.pack("=" + self._letters[:count], *numbers)
        pack = struct.Struct("=" + self._letters[count:]).pack
        return lambda *rest: function(packed + pack(*rest), None)

    def each(
        self, head: Sequence[Any], tails: Sequence[Sequence[Any]]
    ) -> Callable[[Any, int], None] | None:
        """Calls with the same first numbers and different last ones, as one function of a counter
        (the address of one integer) and how many calls at most; None where calls give results.

        Threads that run it together share the calls out.
        """
        if self._each is None:
            return None
        first = struct.pack("=" + self._letters[: len(head)], *head)
        pack = struct.Struct("=" + self._letters[len(head) :]).pack
        packs = [first + pack(*tail) for tail in tails]
        run, whole, count, stride = self._each, b"".join(packs), len(packs), len(packs[0])
        return lambda counter, most: run(whole, stride, counter, count, most)

    def packs(
        self, head: Sequence[Any], middle: int, tails: Sequence[Sequence[Any]]
    ) -> Callable[..., bytes] | None:
        """Arguments of calls with the same first and last numbers, packed one call after another,
        as a function of the numbers in the middle.

        None where calls give results.
        """
        if self._size or self._each is None:
            return None
        begin, end = len(head), len(head) + middle
        first = struct.pack("=" + self._letters[:begin], *head)
        pack = struct.Struct("=" + self._letters[begin:end]).pack
        lasts = [struct.pack("=" + self._letters[end:], *tail) for tail in tails]
        if not middle:
            same = b"".join([first + last for last in lasts])
            return lambda: same
        if len(lasts) == 1:
            last = lasts[0]
            return lambda *numbers: first + pack(*numbers) + last

        def packed(*numbers: float) -> bytes:
            begun = first + pack(*numbers)
            return b"".join([begun + last for last in lasts])

        return packed

    @property
    def stride(self) -> int:
        """Bytes of one call's arguments."""
        return 8 * len(self._letters)

    def calls(self, packs: Callable[..., bytes], count: int, alone: bool) -> Callable[..., None]:
        """So many packed calls as one function, on the threads or on this one `alone`."""
        function, run, stride = self._function, self._each, self.stride
        assert run is not None
        if count == 1:
            return lambda *numbers: function(packs(*numbers), None)

        def here(*numbers: float) -> None:
            counter = ctypes.c_int64(0)
            run(packs(*numbers), stride, ctypes.addressof(counter), count, count)

        def shared(*numbers: float) -> None:
            whole = packs(*numbers)
            share_out(lambda counter, most: run(whole, stride, counter, count, most), count)

        return here if alone else shared
