"""Running a march: portions of steps, what is kept of them, and how it ended, in words."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motes.ode import march, right_hand_side
from motes.ode.arithmetic import Array, Kernel, worst
from motes.ode.march import Control, Pieces, Record
from motes.ode.right_hand_side import Wrap
from motes.ode.solution import Crossings, Event, Work

PORTION = 0.05
"""Seconds that one call of a compiled loop should last, so that Ctrl-C works between calls."""


@dataclass(frozen=True)
class Machine:
    """A method around a right-hand side and events, ready to run from any state."""

    pieces: Pieces
    slopes: int
    rows: int
    advance: Kernel
    sample: Kernel

    @staticmethod
    def build(pieces: Pieces, space: tuple[int, int], events: Kernel | None, wrap: Wrap) -> Machine:
        """Put the loops around a method; `events` watches them, where there are any."""
        if events is None:
            loop = march.steps(
                pieces, right_hand_side.nothing(wrap), march.no_crossings(wrap), wrap
            )
        else:
            loop = march.steps(pieces, events, march.crossings(pieces, events, wrap), wrap)
        return Machine(pieces, *space, loop, march.samples(pieces, wrap))


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
    times: list[Array] = field(default_factory=list)
    states: list[Array] = field(default_factory=list)
    found: list[tuple[Array, Array, Array]] = field(default_factory=list)

    def run(self) -> None:
        """Step to the end, a terminal event, or where no step can be found."""
        size, events = self.y.size, len(self.events)
        start = self.y.copy()
        self.clock = np.array([self.control.start, self.first, 1.0])
        self.counts = np.zeros(9, np.int64)
        self.answers = np.empty((self.asked.size, size))
        self.end = np.empty(size)
        self.k = np.zeros((self.machine.slopes, size))
        self.rows = np.zeros((self.machine.rows, size))
        self.times.append(np.array([self.control.start]))
        self.states.append(start[None])
        kinds = np.array([(e.direction, e.terminal) for e in self.events], np.int64)
        kinds = kinds.reshape(events, 2)
        g = np.zeros((4, events))
        while (
            self.counts[march.ASKED] < self.asked.size
            and self.asked[self.counts[march.ASKED]] == self.clock[march.TIME]
        ):
            self.answers[self.counts[march.ASKED]] = start
            self.counts[march.ASKED] += 1
        if self.control.start == self.control.stop:
            self.counts[march.STATUS] = march.DONE
        portion = 128
        zeros = 0 if not events else 64 + 4 * events
        while self.counts[march.STATUS] == march.RUNNING:
            record = Record(
                self.asked, self.answers, np.empty(portion),
                np.empty((portion if self.keep else 0, size)),
                np.empty(zeros), np.empty((zeros, size)), np.empty(zeros, np.int64),
            )  # fmt: skip
            begin = time.perf_counter()
            with np.errstate(all="ignore"):  # What is not finite is found and said by the march.
                self.machine.advance(
                    self.clock, self.counts, self.y, self.end, self.k, self.rows, g,
                    self.control, record, self.atol, kinds, self.args,
                )  # fmt: skip
            spent = time.perf_counter() - begin
            rows, crossings = self.counts[march.MESH], self.counts[march.FOUND]
            if self.keep:
                self.times.append(record.mesh_t[:rows].copy())
                self.states.append(record.mesh_y[:rows].copy())
            if crossings:
                self.found.append(
                    (
                        record.found_event[:crossings].copy(),
                        record.found_t[:crossings].copy(),
                        record.found_y[:crossings].copy(),
                    )
                )
            portion = int(min(65536, max(16, portion * min(8.0, PORTION / max(spent, 1e-9)))))

    def work(self, shape: tuple[int, ...], name: str = "y") -> Work:
        """Counts and the outcome of a solve for `name`, of that shape."""

        def component(place: int) -> str:
            index = ", ".join(str(i) for i in np.unravel_index(place, shape))
            return f"{name}[{index}]" if shape else name

        status, t = self.counts[march.STATUS], self.clock[march.TIME]
        return Work(
            evaluations=int(self.counts[march.EVALUATIONS]),
            steps=int(self.counts[march.STEPS]),
            rejected=int(self.counts[march.REJECTED]),
            success=status in (march.DONE, march.STOPPED),
            message=self._message(int(status), float(t), component),
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
        place = worst(self.rows[0], self.y, self.end, self.control.rtol, self.atol)
        return (
            f"no step is small enough at t = {t:.10g}: the error of {component(place)} = "
            f"{self.y[place]:.6g} stays above its tolerance. Is the solution singular there, or "
            "the problem stiff?"
        )

    def mesh(self) -> tuple[Array, Array]:
        """Times and states of every step."""
        return np.concatenate(self.times), np.concatenate(self.states)

    def answered(self) -> tuple[Array, Array]:
        """Times that were asked for and reached, and their states."""
        count = self.counts[march.ASKED]
        return self.asked[:count], self.answers[:count]

    def crossings(self, shape: tuple[int, ...]) -> tuple[Crossings, ...]:
        """Zeros of each event."""
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
                    times, np.minimum(places, mesh_t.size - 2), mesh_t, mesh_y, out,
                    np.zeros_like(self.k), np.zeros_like(self.rows), self.args,
                )  # fmt: skip
            return out.reshape((-1, *shape))

        return states


def as_events(events: Sequence[Event | Callable[..., Any]]) -> tuple[Event, ...]:
    """Plain functions as events of both directions that end nothing."""
    return tuple(event if isinstance(event, Event) else Event(event) for event in events)


def checked(state: Array, name: str) -> Array:
    """An initial state as one row, once it is known to be finite."""
    if not np.isfinite(state).all():
        raise ValueError(f"{name} must be finite")
    return state.reshape(-1).copy()


def ends(span: tuple[float, float]) -> tuple[float, float]:
    """Start and end of a span, once they are known to be finite."""
    start, stop = float(span[0]), float(span[1])
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"the span must be finite, not {start:g} to {stop:g}")
    return start, stop


def asked(at: ArrayLike | None, span: tuple[float, float]) -> Array:
    """Times to give states at, checked: within the span, in its direction."""
    start, stop = ends(span)
    times = np.zeros(0) if at is None else np.array(at, float)
    sign = 1.0 if stop >= start else -1.0
    if times.ndim != 1 or (np.diff(sign * times) < 0).any():
        raise ValueError("`at` must be one row of times in the direction of the span")
    if times.size and not (sign * times[0] >= sign * start and sign * times[-1] <= sign * stop):
        raise ValueError(f"`at` must lie within the span, {start:g} to {stop:g}")
    return times


def fixed(span: tuple[float, float], step: float, limit: int) -> Control:
    """Control with a fixed step: n steps, the last shortened to end at the end of the span."""
    if not 0 < step < math.inf:
        raise ValueError(f"step must be above 0, not {step:g}")
    start, stop = ends(span)
    count = max(1, math.ceil(abs(stop - start) / step * (1 - 1e-12)))
    signed = math.copysign(step, stop - start)
    return Control(True, start, stop, signed, count, 0.0, 1.0, math.inf, limit)
