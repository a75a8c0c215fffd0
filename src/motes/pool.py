"""The threads: one call per block of rows, on a few of them.

A thread waits for work in a lock, which wakes it in half the time that a queue takes: a step of ten
thousand particles is a millisecond, and has several such calls.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections import deque
from collections.abc import Callable
from time import sleep
from typing import Any

_threads = 0
_idle: list[_Helper] = []
_helpers = 0


class _Helper:
    """A thread that does one piece of work after another."""

    def __init__(self) -> None:
        self._begun, self._done = threading.Lock(), threading.Lock()
        self._begun.acquire()
        self._done.acquire()
        self._work: Callable[[], None] | None = None
        self._fault: BaseException | None = None
        threading.Thread(target=self._serve, name="motes", daemon=True).start()

    def begin(self, work: Callable[[], None]) -> None:
        """Let the thread work."""
        self._work = work
        self._begun.release()

    def end(self) -> BaseException | None:
        """Wait until the work is done; returns what it raised, and again None after that.

        Work that has not begun is taken back: there is nothing left to do.
        """
        if self._work is None:
            return None
        if not self._begun.acquire(blocking=False):
            self._done.acquire()
        fault, self._work, self._fault = self._fault, None, None
        _idle.append(self)
        return fault

    def _serve(self) -> None:
        while True:
            self._begun.acquire()
            try:
                if self._work is not None:
                    self._work()
            except BaseException as fault:
                self._fault = fault
            self._done.release()


def _hired(count: int) -> list[_Helper]:
    """At most so many helpers: those that are idle, and new ones while there are few."""
    global _helpers
    found: list[_Helper] = []
    while len(found) < count:
        try:
            found.append(_idle.pop())
        except IndexError:
            if _helpers >= threads():
                break
            _helpers += 1
            found.append(_Helper())
    return found


def _forget() -> None:
    """A process that was forked has no threads but its own."""
    global _helpers
    _idle.clear()
    _helpers = 0


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def threads(count: int | None = None) -> int:
    """Number of threads that kernels use; with `count`, set it first (0: one per processor).

    The environment variable MOTES_THREADS sets the first value. Results never depend on it.
    """
    global _threads
    if count is None and not _threads:
        try:
            count = int(os.environ.get("MOTES_THREADS", "0"))
        except ValueError:
            count = 0
    if count is not None:
        if count < 0:
            raise ValueError(f"threads must be 0 (one per processor) or more, not {count}")
        _threads = count or available_processors()
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
    numbers = iter(range(count))  # Each thread takes the next one.

    def work() -> None:
        for number in numbers:
            task(number)

    _together(work, count, lambda: deque(numbers, 0))


def _together(work: Callable[[], None], count: int, drop: Callable[[], Any]) -> None:
    """Work on all threads that so many tasks are enough for; `drop` takes away what is left."""
    helpers = _hired(min(threads(), count) - 1) if count > 1 else []
    try:
        for helper in helpers:
            helper.begin(work)
        work()
        faults = [helper.end() for helper in helpers]
    except BaseException:
        drop()
        for helper in helpers:
            helper.end()
        raise
    for fault in faults:
        if fault is not None:
            raise fault


AT_ONCE = 16
"""Calls that a thread does before it looks whether it was interrupted."""


def share_out(run: Callable[[Any, int], None], count: int) -> None:
    """Run calls that are taken from a counter, on the threads."""
    counter = ctypes.c_int64(0)

    def work() -> None:
        while counter.value < count:
            run(ctypes.addressof(counter), AT_ONCE)

    _together(work, count, lambda: setattr(counter, "value", count))


WAITING = 2
"""What a function for `share_phases` returns when it has waited long for other threads."""


def share_phases(run: Callable[[], int], count: int, stop: Callable[[], Any]) -> None:
    """Run what does some calls, as long as it returns anything but 0, on as many threads as there
    are calls at once; `stop` lets no more begin."""

    def work() -> None:
        while left := run():
            if left == WAITING:
                _give_way()

    _together(work, count, stop)


def _give_way() -> None:
    """Let others have the processor: somebody may need it who is waited for."""
    if hasattr(os, "sched_yield"):
        os.sched_yield()
    else:
        sleep(0)


BRIEF = 1 << 14
"""Rows of a loop of a nanosecond a row that are done before a second thread has woken up."""


def even_blocks(rows: int) -> list[tuple[int, int]]:
    """Blocks of rows for a loop of a nanosecond a row: several even for few rows, so that threads
    that are awake have equal shares."""
    return blocks(rows, min(max(-(-rows // 8), 1 << 11), 1 << 13))


def blocks(rows: int, size: int) -> list[tuple[int, int]]:
    """Half-open ranges of at most `size` rows that cover `rows`."""
    return [(low, min(low + size, rows)) for low in range(0, rows, size)]
