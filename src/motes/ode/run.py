"""Running a march: portions of steps, what is kept of them, and how it ended, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from motes import jit
from motes.ode import march, right_hand_side
from motes.ode.arithmetic import Array, Kernel, worst
from motes.ode.march import Control, Pieces, Record, Room
from motes.ode.right_hand_side import Wrap
from motes.ode.solution import Crossings, Event, Work

PORTION = 0.05
"""Seconds that one call of a compiled loop should last, so that Ctrl-C works between calls."""

MOST = 2.0**53
"""Fixed steps that can be counted: beyond, n + 1 is n."""


@dataclass(frozen=True)
class Machine:
    """A method around a right-hand side and events, ready to run from any state."""

    room: Room
    advance: Kernel
    sample: Kernel

    @staticmethod
    def build(pieces: Pieces, room: Room, events: Kernel | None, wrap: Wrap) -> Machine:
        """Put the loops around a method; `events` watches them, where there are any."""
        if events is None:
            watch, cross = right_hand_side.nothing(wrap), march.no_crossings(wrap)
        else:
            watch, cross = events, march.crossings(pieces, events, wrap)
        loop = march.steps(pieces, room, watch, cross, wrap)
        return Machine(room, loop, march.samples(pieces, wrap))


@dataclass
class March:
    """One solve: the state of its loop, and all that it has kept."""

    machine: Machine
    control: Control
    y: Array
    atol: Array
    events: Sequence[Event]
    args: tuple[Any, ...]
    asked: Array
    keep: bool
    """Whether every step is kept, for dense output."""
    first: float
    """Length of the first step, where steps vary; 0: find one."""
    inner: tuple[Array | float, float] | None = None
    """Absolute and relative tolerance of Newton's method, where the method is implicit."""
    times: list[Array] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    found: list[tuple[Array, Array, Array]] = field(default_factory=list)

    def run(self, refuse: Callable[[], None]) -> None:
        """Step to the end, a terminal event, or where no step can be found.

        `refuse` raises what is wrong with the user's compiled function, if anything is: it is
        called where that cannot be compiled, or not one step could be taken.
        """
        try:
            self._run()
        except Exception:
            if isinstance(self.machine.advance, jit.Kernel):
                refuse()
            raise
        ended = self.counts[march.STATUS]
        if self.counts[march.STEPS] == 0 and ended in (march.INFINITE, march.TOO_SMALL):
            refuse()

    def _run(self) -> None:
        size, events, start = self.y.size, len(self.events), self.control.start
        self.clock = np.array([start, self.first, 0.0])
        self.counts = counts = np.zeros(9, np.int64)
        self.answers = np.empty((self.asked.size, size))
        self.memory = self._memory()
        self.memory[:size] = self.y
        kinds = np.empty((events, 2), np.int64)
        for row, event in zip(kinds, self.events, strict=True):
            row[:] = event.direction, event.terminal
        g = np.zeros((4, events))
        for time in self.asked:
            if time != start:
                break
            self.answers[counts[march.ASKED]] = self.y
            counts[march.ASKED] += 1
        if start == self.control.stop:
            counts[march.STATUS] = march.DONE
        # Only plain functions need it: what is not finite is found and said by the march.
        quiet = nullcontext() if isinstance(self.machine.advance, jit.Kernel) else _quiet()
        portion = max(128, min(1024, 8192 // max(1, size)))
        zeros = 0 if not events else 64 + 4 * events
        record = self._record(portion, zeros)
        # The mesh begins with the start.
        record.mesh_t[0] = start
        record.mesh_y[:1] = self.y
        counts[march.MESH] = 1
        with quiet:
            while counts[march.STATUS] == march.RUNNING:
                begin = perf_counter()
                self.machine.advance(
                    self.clock, counts, self.memory, g, self.control, record, self.atol,
                    kinds, self.args,
                )  # fmt: skip
                spent = perf_counter() - begin
                if counts[march.STATUS] == march.RUNNING:
                    self._keep(record)
                    most = min(8.0, PORTION / max(spent, 1e-9))
                    portion = int(min(65536, max(16, portion * most)))
                    record = self._record(portion, zeros)
                    counts[march.MESH] = counts[march.FOUND] = 0
        self._keep(record)

    def _memory(self) -> Array:
        room, size = self.machine.room, self.y.size
        result = _aligned(room.rows * size)
        if room.tolerances is not None and self.inner is not None:
            rows = result[room.tolerances * size : (room.tolerances + 2) * size].reshape(2, size)
            rows[0], rows[1] = self.inner
        return result

    def _record(self, portion: int, zeros: int) -> Record:
        size = self.y.size
        return Record(
            self.asked, self.answers, np.empty(portion),
            np.empty((portion if self.keep else 0, size)),
            np.empty(zeros), np.empty((zeros, size)), np.empty(zeros, np.int64),
        )  # fmt: skip

    def _keep(self, record: Record) -> None:
        rows, crossings = self.counts[march.MESH], self.counts[march.FOUND]
        if self.keep:
            self.times.append(record.mesh_t[:rows])
            self.states.append(record.mesh_y[:rows])
        if crossings:
            found = record.found_event, record.found_t, record.found_y
            event, t, y = (column[:crossings].copy() for column in found)
            self.found.append((event, t, y))

    def work(self, shape: tuple[int, ...], name: str = "y") -> Work:
        """Counts and the outcome of a solve for `name`, of that shape."""

        def component(place: int) -> str:
            index = ", ".join(str(i) for i in np.unravel_index(place, shape))
            return f"{name}[{index}]" if shape else name

        counts = self.counts.tolist()
        status, t = counts[march.STATUS], float(self.clock[march.TIME])
        return Work(
            evaluations=counts[march.EVALUATIONS],
            steps=counts[march.STEPS],
            rejected=counts[march.REJECTED],
            success=status in (march.DONE, march.STOPPED),
            message=self._message(status, t, component),
        )

    def _message(self, status: int, t: float, component: Callable[[int], str]) -> str:
        if status == march.DONE:
            return f"reached t = {t:.10g}"
        if status == march.STOPPED:
            return f"stopped by event {self.found[-1][0][-1]} at t = {t:.10g}"
        if status == march.TOO_MANY:
            return (
                f"{self.control.limit} steps lead only to t = {t:.10g}; allow more with max_steps"
            )
        if status == march.INFINITE:
            place = int(self.counts[march.PLACE])
            if place < 0:
                return (
                    f"the equations of a step at t = {t:.10g} have no solution; try a smaller step"
                )
            return f"{component(place)} became infinite after t = {t:.10g}; try a smaller step"
        assert status == march.TOO_SMALL
        rows = self.memory.reshape(-1, self.y.size)
        spare = march.FIRST_SLOPE + self.machine.room.slopes
        place = worst(rows[spare], rows[0], rows[1], self.control.rtol, self.atol)
        return (
            f"no step is small enough at t = {t:.10g}: the error of {component(place)} = "
            f"{rows[0, place]:.6g} stays above its tolerance. Is the solution singular there, or "
            "the problem stiff?"
        )

    def mesh(self) -> tuple[Array, Array]:
        """Times and states of every step."""
        if len(self.times) > 1:
            self.times = [np.concatenate(self.times)]
            self.states = [np.concatenate(self.states)]
        return self.times[0], self.states[0]

    def answered(self) -> tuple[Array, Array]:
        """Times that were asked for and reached, and their states."""
        count = self.counts[march.ASKED]
        return self.asked[:count], self.answers[:count]

    def crossings(self, shape: tuple[int, ...]) -> tuple[Crossings, ...]:
        """Zeros of each event."""
        if not self.events:
            return ()
        event, t, y = (
            (np.concatenate(column) for column in zip(*self.found, strict=True))
            if self.found
            else (np.zeros(0, int), np.zeros(0), np.zeros((0, self.y.size)))
        )
        return tuple(
            Crossings(t[event == e], y[event == e].reshape((-1, *shape)))
            for e in range(len(self.events))
        )

    def dense(self, shape: tuple[int, ...]) -> Callable[[Array], Array]:
        """Dense output over the steps that were kept."""
        mesh_t, mesh_y = self.mesh()
        sign = 1.0 if self.control.stop >= self.control.start else -1.0

        def states(times: Array) -> Array:
            low, high = sorted((mesh_t[0], mesh_t[-1]))
            if times.size and not (times.min() >= low and times.max() <= high):
                raise ValueError(f"times must lie within the solved span, {low:g} to {high:g}")
            out = np.empty((times.size, mesh_y.shape[1]))
            if mesh_t.size == 1:
                out[:] = mesh_y[0]
            else:
                places = np.searchsorted(sign * mesh_t, sign * times, side="right") - 1
                self.machine.sample(
                    times, np.minimum(places, mesh_t.size - 2), mesh_t, mesh_y, self._memory(),
                    out, self.args,
                )  # fmt: skip
            return out.reshape((-1, *shape))

        return states


def _aligned(count: int) -> Array:
    """Zeros that begin where a cache line does: that saves up to a tenth of a solve."""
    block = np.zeros(count + 8)
    skip = -block.ctypes.data % 64 // 8
    return block[skip : skip + count]


def _quiet() -> AbstractContextManager[Any]:
    return np.errstate(all="ignore")


def as_events(events: Sequence[Event | Callable[..., Any]]) -> tuple[Event, ...]:
    """Plain functions as events of both directions that end nothing."""
    try:
        found = tuple(event if isinstance(event, Event) else Event(event) for event in events)
    except TypeError:
        raise ValueError(f"events must be a list of functions, not {events!r}") from None
    for event in found:
        if not callable(event.function):
            raise ValueError(f"an event must be a function g(t, y, *args), not {event.function!r}")
        if event.direction not in (-1, 0, 1):
            raise ValueError(f"an event's direction must be -1, 0 or 1, not {event.direction!r}")
    return found


def further(args: Any) -> tuple[Any, ...]:
    """Further arguments of a function, once they are known to be a tuple or list."""
    if not isinstance(args, tuple | list):
        raise ValueError(f"args must be a tuple, such as (1.0,), not {args!r}")
    return tuple(args)


def counted(limit: float) -> int:
    """A number of steps, once it is known to be one."""
    if not isinstance(limit, SupportsFloat) or not (
        float(limit) >= 1 and float(limit).is_integer()
    ):
        raise ValueError(f"max_steps must be a whole number of at least 1, not {limit!r}")
    return int(limit)


def numbers(values: ArrayLike, name: str) -> Array:
    """An array of real numbers, once they are known to be such."""
    try:
        return np.array(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be real numbers, not {str(values)[:60]}") from None


def positive(value: float, name: str) -> None:
    """Refuse a length that is no finite number above 0."""
    if not isinstance(value, SupportsFloat) or not 0 < float(value) < math.inf:
        raise ValueError(f"{name} must be above 0, not {value}")


def checked(state: Array, name: str) -> Array:
    """An initial state as one row, once it is known to be finite."""
    flat = state.reshape(-1)
    if not flat.size:
        raise ValueError(f"{name} must have at least one number")
    if not np.isfinite(flat).all():
        raise ValueError(f"{name} must be finite")
    return flat


def ends(span: tuple[float, float]) -> tuple[float, float]:
    """Start and end of a span, once they are known to be finite."""
    try:
        start, stop = map(float, span)
    except (TypeError, ValueError):
        raise ValueError(f"the span must be two times, (t0, t1), not {span!r}") from None
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"the span must be finite, not {start:g} to {stop:g}")
    return start, stop


def asked(at: ArrayLike | None, span: tuple[float, float]) -> Array:
    """Times to give states at, checked: within the span, in its direction."""
    start, stop = ends(span)
    if at is None:
        return np.zeros(0)
    times = numbers(at, "at")
    sign = 1.0 if stop >= start else -1.0
    if times.ndim != 1 or not (np.diff(sign * times) >= 0).all():
        raise ValueError("`at` must be one row of times in the direction of the span")
    if times.size and not (sign * times[0] >= sign * start and sign * times[-1] <= sign * stop):
        raise ValueError(f"`at` must lie within the span, {start:g} to {stop:g}")
    return times


def fixed(span: tuple[float, float], step: float, limit: int) -> Control:
    """Control with a fixed step: n steps, the last shortened to end at the end of the span."""
    positive(step, "step")
    start, stop = ends(span)
    steps = abs(stop - start) / step
    if not steps < MOST:
        raise ValueError(f"step must be longer than {step:g}: these would be {steps:.3g} steps")
    count = max(1, math.ceil(steps * (1 - 1e-12)))
    signed = math.copysign(step, stop - start)
    return Control(True, start, stop, signed, count, 0.0, 1.0, math.inf, limit)
