"""Kernel calls that are the same from step to step, so that Python takes their arrays apart once.

A step of a few thousand particles is a few hundred microseconds of machine code in some ten calls,
each of which would cost ten more for its arguments; a relay does several of them in one.
"""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import Calls, Kernel, share
from motes.machine.door import PLAIN, Door, spread
from motes.machine.relay import COUNTERS, runner
from motes.pool import share_phases

NUMBERS = PLAIN | {bool}
"""Types whose equal values are equal arguments."""

Packs = Callable[..., bytes]


class Repeat:
    """Calls of a kernel that returns nothing, with the same arrays again and again.

    Called with numbers, it calls the kernel with `(*head, *numbers, *tail)` for every tail, on the
    threads, or on this one if they are `brief`. What does not change is taken apart once.
    """

    def __init__(
        self, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any], brief: bool = False
    ) -> None:
        self.kernel, self.head, self.tails, self.brief = kernel, tuple(head), tails, brief
        self._ids = list(map(id, self.head))
        self._known: tuple[type, ...] | None = None
        self._door: Door | None = None
        self._begin = 0
        self._packs: Packs = lambda *numbers: b""
        self._run: Callable[..., None] = lambda *numbers: None

    @property
    def count(self) -> int:
        """How many calls."""
        return len(self.tails.tails if isinstance(self.tails, Calls) else self.tails)

    def fits(self, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any]) -> bool:
        """Whether these are its calls."""
        same = self.kernel is kernel and (self.tails is tails or self.tails == tails)
        return same and (self._ids == list(map(id, head)) or all(map(_alike, self.head, head)))

    def __call__(self, *numbers: float) -> None:
        """Call with these numbers, which are always of the same types, in the middle."""
        if self._known != tuple(map(type, numbers)):
            self._prepare(numbers)
        self._run(*numbers)

    def packed(self, numbers: NDArray[Any] | None) -> tuple[Door, bytes] | None:
        """The kernel's door, and the arguments of all calls, with each row of these numbers in the
        middle if there are any; None where Numba compiled it."""
        first = () if numbers is None else numbers[0].tolist()
        if self._known != tuple(map(type, first)):
            self._prepare(first)
        if self._door is None:
            return None
        packs = self._packs(*first)
        if numbers is None:
            return self._door, packs
        words = np.frombuffer(packs * len(numbers), numbers.dtype).copy()
        words = words.reshape(len(numbers), self.count, -1)
        words[:, :, self._begin : self._begin + numbers.shape[1]] = numbers[:, None]
        return self._door, words.tobytes()

    def _prepare(self, numbers: Sequence[float]) -> None:
        self._known, self._door = tuple(map(type, numbers)), None
        calls = self.tails if isinstance(self.tails, Calls) else Calls(self.tails)
        tails, kernel, head = calls.tails, self.kernel, self.head
        if tails and isinstance(kernel, Kernel):
            key: list[Any] = []
            given: list[Any] = []
            for argument in head:
                spread(argument, key, given)
            for number in numbers:
                spread(number, key, [])
            last, lasts = calls.spread()
            door = kernel.door((*key, *last), (*head, *numbers, *tails[0]))
            packs = None if door is kernel else door.packs(given, len(numbers), lasts)
            if packs is not None:
                self._door, self._packs, self._begin = door, packs, len(given)
                self._run = door.calls(packs, len(tails), self.brief)
                return
        self._run = lambda *numbers: share(lambda k: kernel(*head, *numbers, *tails[k]), len(tails))


class Relay:
    """Calls of several kernels, one kernel after another, in some rounds, in one go on the threads.

    `stopped` is an array of one number that kernels may set: where it is not 0, nothing further is
    called. A thread does so many calls `at_once`, before it looks whether it was interrupted.
    `possible` tells whether all kernels can be called so.
    """

    def __init__(self, rounds: int, stopped: Any, at_once: int) -> None:
        self.rounds, self.stopped, self.at_once, self.possible = rounds, stopped, at_once, True
        self._phases: list[tuple[Door, int, int, int]] = []
        self._packs: list[bytes] = []
        self._size = self._most = 0

    def add(self, calls: Repeat, numbers: NDArray[Any] | None = None) -> None:
        """Append calls; with a row of numbers (rounds, m) in the middle, if there are any."""
        count = calls.count
        if not count:
            return
        packed = calls.packed(numbers)
        if packed is None:
            self.possible = False
            return
        door, packs = packed
        further = 0 if numbers is None else len(packs) // len(numbers)
        self._phases.append((door, self._size, count, further))
        self._packs.append(packs)
        self._size += len(packs)
        self._most = max(self._most, count)

    def run(self) -> None:
        """Call."""
        packs, phases = b"".join(self._packs), len(self._phases)
        begin = ctypes.cast(ctypes.c_char_p(packs), ctypes.c_void_p).value or 0
        table = array("q")
        for door, at, count, further in self._phases:
            table.extend((door.address, begin + at, door.stride, count, further))
        total = phases * self.rounds
        counters = array("q", bytes(8 * COUNTERS * total))
        where, counted, stopped = (
            table.buffer_info()[0], counters.buffer_info()[0], self.stopped.ctypes.data,
        )  # fmt: skip
        given = where, phases, counted, total, self.at_once, stopped
        share_phases(partial(runner(), *given), self._most, lambda: self.stopped.fill(-1))


def _alike(known: Any, given: Any) -> bool:
    """Whether an argument is what it was: the same array, or an equal number."""
    if known is given:
        return True
    if isinstance(known, tuple) and isinstance(given, tuple):
        return len(known) == len(given) and all(map(_alike, known, given))
    return type(known) is type(given) and type(known) in NUMBERS and bool(known == given)


class Repeats:
    """Calls that are the same from step to step, by name, for as long as their arrays are."""

    def __init__(self) -> None:
        self._known: dict[Any, Repeat] = {}

    def __call__(
        self, name: Any, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any],
        brief: bool = False,
    ) -> Repeat:  # fmt: skip
        """What calls a kernel with such arrays: that of before if they are the same."""
        known = self._known.get(name)
        if known is None or not known.fits(kernel, head, tails):
            known = self._known[name] = Repeat(kernel, head, tails, brief)
        return known
