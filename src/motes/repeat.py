"""Kernel calls that are the same from step to step, so that Python takes their arrays apart once.

A step of a few thousand particles is a few hundred microseconds of machine code in some ten calls,
each of which would cost ten more for its arguments.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from motes.jit import Calls, Kernel, share
from motes.machine.door import PLAIN, spread

NUMBERS = PLAIN | {bool}
"""Types whose equal values are equal arguments."""


class Repeat:
    """Calls of a kernel that returns nothing, with the same arrays again and again.

    Called with numbers, it calls the kernel with `(*head, *numbers, *tail)` for every tail, on the
    threads. What does not change is taken apart once.
    """

    def __init__(self, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any]) -> None:
        self.kernel, self.head, self.tails = kernel, tuple(head), tails
        self._ids = list(map(id, self.head))
        self._known: tuple[tuple[type, ...], Callable[..., None]] | None = None

    def fits(self, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any]) -> bool:
        """Whether these are its calls."""
        same = self.kernel is kernel and (self.tails is tails or self.tails == tails)
        return same and (self._ids == list(map(id, head)) or all(map(_alike, self.head, head)))

    def __call__(self, *numbers: float) -> None:
        """Call with these numbers, which are always of the same types, in the middle."""
        kinds = tuple(map(type, numbers))
        if self._known is None or self._known[0] != kinds:
            self._known = kinds, self._prepared(numbers)
        self._known[1](*numbers)

    def _prepared(self, numbers: Sequence[float]) -> Callable[..., None]:
        calls = self.tails if isinstance(self.tails, Calls) else Calls(self.tails)
        tails, kernel, head = calls.tails, self.kernel, self.head
        if not tails:
            return lambda *numbers: None
        if isinstance(kernel, Kernel):
            key: list[Any] = []
            given: list[Any] = []
            for argument in head:
                spread(argument, key, given)
            for number in numbers:
                spread(number, key, [])
            last, lasts = calls.spread()
            door = kernel.door((*key, *last), (*head, *numbers, *tails[0]))
            run = None if door is kernel else door.again(given, len(numbers), lasts)
            if run is not None:
                return run  # type: ignore[no-any-return]
        return lambda *numbers: share(lambda k: kernel(*head, *numbers, *tails[k]), len(tails))


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
        self, name: Any, kernel: Any, head: Sequence[Any], tails: Calls | Sequence[Any]
    ) -> Repeat:
        """What calls a kernel with such arrays: that of before if they are the same."""
        known = self._known.get(name)
        if known is None or not known.fits(kernel, head, tails):
            known = self._known[name] = Repeat(kernel, head, tails)
        return known
