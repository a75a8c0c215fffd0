"""The threads: one call per block of rows, on a few of them.

A thread waits for work in a lock, which wakes it in half the time that a queue takes: a step of ten
thousand particles is a millisecond, and has several such calls.

An interrupt (Ctrl-C) may come between any two lines here that the main thread runs. So all that it
does can be done twice: who owns a piece of work is settled once and can be asked again.
"""

from __future__ import annotations

import ctypes
import os
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from time import sleep
from typing import Any

_threads = 0
_helpers: list[_Helper] = []


class _Job:
    """A piece of work that a helper is asked for, and that is done at most once."""

    def __init__(self, work: Callable[[], None]) -> None:
        self._work: Callable[[], None] | None = work
        self.over = False
        self._owner: dict[int, object] = {}
        self._done = threading.Lock()
        self._done.acquire()
        self._fault: BaseException | None = None

    def _belongs(self, to: object) -> bool:
        """Whether it belongs to who asks: it is the first one's who does, for good."""
        return self._owner.setdefault(0, to) is to

    def run(self) -> None:
        """Do the work in a helper, unless somebody has begun or taken it back."""
        if self._work is None or not self._belongs(object()):
            return
        try:
            self._work()
        except BaseException as fault:
            self._fault = fault
        self._work = None  # A helper keeps its last job, which shall not keep arrays.
        self.over = True
        self._done.release()

    def end(self) -> BaseException | None:
        """Wait until the work is done, and give what it raised.

        Work that has not begun is taken back: there is nothing left to do.
        """
        if self._belongs(self):
            self._work, self.over = None, True
        elif not self.over:
            self._done.acquire()
        return self._fault


class _Helper:
    """A thread that does one job after another."""

    def __init__(self) -> None:
        self._wake = threading.Lock()
        self._wake.acquire()
        self._job: _Job | None = None
        threading.Thread(target=self._serve, name="motes", daemon=True).start()

    @property
    def free(self) -> bool:
        """Whether it does nothing, as far as one can know: two may ask at once, and then one of
        them does its job alone."""
        return self._job is None or self._job.over

    def begin(self, job: _Job) -> None:
        """Let the thread do a job."""
        self._job = job
        with suppress(RuntimeError):  # It is awake already.
            self._wake.release()

    def _serve(self) -> None:
        while True:
            self._wake.acquire()
            if self._job is not None:
                self._job.run()


def _hired(count: int) -> list[_Helper]:
    """At most so many helpers: those that are free, and new ones while there are few."""
    found = [helper for helper in _helpers if helper.free]
    while len(found) < count and len(_helpers) < threads():
        found.append(_Helper())
        _helpers.append(found[-1])
    return found[:count]


if hasattr(os, "register_at_fork"):  # A process that was forked has no threads but its own.
    os.register_at_fork(after_in_child=_helpers.clear)


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

    def helped() -> None:
        try:
            work()
        except BaseException:
            drop()
            raise

    jobs: list[_Job] = []
    try:
        for helper in _hired(min(threads(), count) - 1) if count > 1 else []:
            jobs.append(_Job(helped))
            helper.begin(jobs[-1])
        work()
        faults = [job.end() for job in jobs]
    except BaseException:
        drop()
        _await(jobs)
        raise
    for fault in faults:
        if fault is not None:
            raise fault


def _await(jobs: list[_Job]) -> None:
    """Wait for what is running, which uses arrays of the caller's: also when interrupted again."""
    while True:
        try:
            for job in jobs:
                job.end()
            return
        except KeyboardInterrupt:
            continue


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
