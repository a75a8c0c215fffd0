"""The march of a one-step method through time: step control, dense output and events, once for all.

A method is a `Pieces`: how it begins, takes a step, and estimates its error. The loop is one source
for two uses: compiled around a compiled right-hand side, or run as it is around a Python function.
It works in portions, so that no call lasts long and results need no limit known beforehand.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from motes.ode.arithmetic import Array, Kernel, add, copy, first_infinite, norm
from motes.ode.right_hand_side import Wrap

RUNNING, DONE, STOPPED, TOO_SMALL, INFINITE, TOO_MANY = range(6)
"""How a march stands: at work, at the end, at a terminal event, or stuck for three reasons."""

TIME, STEP, ERROR = range(3)
"""Places in `clock`: time, next step, logarithm of the last accepted step's error."""

SAFETY, LAST, NOW = 0.87, 0.15, 0.9
"""Step control: the next step is SAFETY x (last error)^(LAST / order) / (this one)^(NOW / order) as
long. Chosen for the fewest evaluations at equal error, of eighth order, on six problems."""

SMALL = math.log(1e-4)
"""The least that counts for the last step's error: one lucky step must not hold back the next."""

EVALUATIONS, STEPS, REJECTED, STATUS, ASKED, MESH, FOUND, RETRY, PLACE = range(9)
"""Places in `counts`: work done, status; rows used of `asked`, mesh, found; flag; component."""

PARTS = 4
"""Parts of a step in which events look for a change of sign."""


FIRST_SLOPE = 2
"""Row of a march's memory in which slopes begin."""


class Pieces(NamedTuple):
    """One method around one right-hand side.

    A march has one block of memory, w, of rows as long as the state: the state y at the start of
    the step, that at its end, the slopes, and spare rows. y and end are views of the first two.
    Slopes begin with that at the start of the step and end with that at its end. In one block with
    rows of known length, sums over rows need no tests for overlaps: half the time of separate ones.

    begin(t, y, w, args) -> evaluations: fills the first slope with f(t, y).
    take(t, y, end, w, h, args) -> evaluations, or less than 0 where no solution was found.
    close(t, end, w, args) -> evaluations: the slope at the end of a step that was accepted.
    error(t, y, end, w, h, rtol, atol, args) -> norm of the estimated error, 1 is just allowed, and
    evaluations; leaves the estimate in the first spare row.
    prepare(t, y, end, w, h, args) -> evaluations, for dense output.
    inside(share, t, y, w, h, out, args) -> evaluations: the state within the step.
    """

    begin: Kernel
    take: Kernel
    close: Kernel
    error: Kernel
    prepare: Kernel
    inside: Kernel


class Room(NamedTuple):
    """Rows of a march's memory."""

    slopes: int
    spare: int
    tolerances: int | None = None
    """Row that a solve fills with its own absolute tolerances, before one with its relative one."""

    @property
    def rows(self) -> int:
        """All rows."""
        return FIRST_SLOPE + self.slopes + self.spare


def partial_step(take: Kernel, wrap: Wrap) -> tuple[Kernel, Kernel]:
    """`prepare` and `inside` of a method without an interpolant: a shorter step of its own."""

    @wrap.part
    def prepare(t, y, end, w, h, args):  # type: ignore[no-untyped-def]
        return 0

    @wrap.part
    def inside(share, t, y, w, h, out, args):  # type: ignore[no-untyped-def]
        if share == 0.0:
            copy(y, out)
            return 0
        other, n = np.empty(w.size), y.size
        copy(w, other)
        evaluations = abs(take(t, other[:n], other[n : 2 * n], other, share * h, args))
        copy(other[n : 2 * n], out)
        return evaluations

    return prepare, inside


class Control(NamedTuple):
    """Step control: a fixed step, or tolerances (Hairer, Norsett and Wanner I, section II.4)."""

    fixed: bool
    start: float
    stop: float
    step: float
    number: int
    """Number of fixed steps; the last one ends at `stop`."""
    rtol: float
    order: float
    """The error is proportional to the step to this power."""
    largest: float
    limit: int
    """Steps after which the march gives up."""
    most: float = 10.0
    """Ratio of a step to the one before it at most."""


class Record(NamedTuple):
    """Where results go; the caller makes room, and says what of it is filled."""

    asked: Array
    """Times at which states are asked for, in the direction of the march."""
    answers: Array
    mesh_t: Array
    mesh_y: Array
    found_t: Array
    found_y: Array
    found_event: Any
    """Number of the event of each zero found."""


def steps(pieces: Pieces, room: Room, watch: Kernel, cross: Kernel, wrap: Wrap) -> Kernel:
    """The loop over steps; `wrap` compiles it, or leaves it as it is."""
    begin, take, close, error, prepare, inside = pieces
    final, spare = FIRST_SLOPE + room.slopes - 1, FIRST_SLOPE + room.slopes

    @wrap.part
    def first(t, y, end, w, sign, control, atol, counts, args):  # type: ignore[no-untyped-def]
        """A first step from sizes of y, y', y'' (Hairer, Norsett and Wanner I, section II.4)."""
        n = y.size
        slope, before = w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[spare * n : (spare + 1) * n]
        span = min(abs(control.stop - control.start), control.largest)
        state = norm(y, y, y, control.rtol, atol)
        speed = norm(slope, y, y, control.rtol, atol)
        trial = 1e-6
        if speed < math.inf and state >= 1e-5 and speed >= 1e-5:
            trial = 0.01 * state / speed
        trial = min(trial, span)
        add(y, sign * trial, slope, end)
        copy(slope, before)
        counts[EVALUATIONS] += begin(t + sign * trial, end, w, args)
        add(slope, -1.0, before, slope)
        most = max(speed, norm(slope, y, y, control.rtol, atol) / trial)
        copy(before, slope)
        if not most < math.inf:
            return trial
        better = max(1e-6, trial * 1e-3)
        if most > 1e-15:
            better = np.power(0.01 / most, 1.0 / control.order)
        return min(100.0 * trial, better, span)

    @wrap.loop
    def advance(clock, counts, w, g, control, record, atol, kinds, args):  # type: ignore[no-untyped-def]
        n = atol.size
        y, end = w[:n], w[n : 2 * n]
        slope, following = w[FIRST_SLOPE * n : (FIRST_SLOPE + 1) * n], w[final * n : spare * n]
        asked, mesh_t, mesh_y = record.asked, record.mesh_t, record.mesh_y
        sign = 1.0 if control.stop >= control.start else -1.0
        events, state = kinds.shape[0], np.empty(n)
        if counts[STEPS] == 0 and counts[REJECTED] == 0:
            counts[EVALUATIONS] += begin(clock[TIME], y, w, args)
            watch(clock[TIME], y, g[0], args)
            if not control.fixed and clock[STEP] == 0.0:
                clock[STEP] = first(clock[TIME], y, end, w, sign, control, atol, counts, args)
        while (
            counts[STATUS] == RUNNING
            and counts[MESH] < mesh_t.size
            and counts[FOUND] + PARTS * events <= record.found_t.size
        ):
            t = clock[TIME]
            if counts[STEPS] + counts[REJECTED] >= control.limit:
                counts[STATUS] = TOO_MANY
                break
            if control.fixed:
                steps = counts[STEPS] + 1
                after = control.start + steps * control.step
                if steps >= control.number:
                    after = control.stop
                h = after - t
            else:
                h = sign * min(abs(clock[STEP]), control.largest)
                after = t + h
                if sign * (t + 1.01 * h - control.stop) >= 0.0:
                    after = control.stop
                    h = after - t
            done = take(t, y, end, w, h, args)
            counts[EVALUATIONS] += abs(done)
            if control.fixed:
                bad = first_infinite(end)
                if bad >= 0 or done < 0:
                    counts[PLACE] = bad
                    counts[STATUS] = INFINITE
                    break
            else:
                size = math.inf
                if done >= 0:
                    size, done = error(t, y, end, w, h, control.rtol, atol, args)
                    counts[EVALUATIONS] += done
                if not size <= 1.0:
                    counts[REJECTED] += 1
                    counts[RETRY] = 1
                    shrink = 0.0
                    if size < math.inf:
                        shrink = 0.9 * np.power(size, -1.0 / control.order)
                    clock[STEP] = h * max(0.1, shrink)
                    if abs(clock[STEP]) <= 4e-16 * abs(t) or abs(clock[STEP]) < 1e-300:
                        counts[STATUS] = TOO_SMALL
                    continue
                # Proportional and integral control: the last two errors choose the next step.
                now = np.log(max(size, 1e-10))
                grow = SAFETY * np.exp((LAST * clock[ERROR] - NOW * now) / control.order)
                grow = min(control.most, max(0.2, grow))
                clock[STEP] = h * (min(1.0, grow) if counts[RETRY] else grow)
                clock[ERROR] = max(now, SMALL)
                counts[RETRY] = 0
            counts[EVALUATIONS] += close(after, end, w, args)
            counts[STEPS] += 1

            reach = after
            if events or (
                counts[ASKED] < asked.size and sign * (asked[counts[ASKED]] - after) < 0.0
            ):
                counts[EVALUATIONS] += prepare(t, y, end, w, h, args)
                share = cross(t, y, end, w, h, g, counts, record, kinds, args)
                if share <= 1.0:
                    reach = t + share * h
                    counts[STATUS] = STOPPED
            while counts[ASKED] < asked.size and sign * (asked[counts[ASKED]] - reach) <= 0.0:
                answer, time = record.answers[counts[ASKED]], asked[counts[ASKED]]
                counts[ASKED] += 1
                if time == after:
                    answer[:] = end
                else:
                    counts[EVALUATIONS] += inside((time - t) / h, t, y, w, h, answer, args)
            if counts[STATUS] == STOPPED:
                counts[EVALUATIONS] += inside((reach - t) / h, t, y, w, h, state, args)
                copy(state, end)
            clock[TIME] = reach
            y[:] = end
            slope[:] = following
            if mesh_y.shape[0]:
                mesh_y[counts[MESH]] = y
            mesh_t[counts[MESH]] = reach
            counts[MESH] += 1
            if counts[STATUS] == RUNNING and reach == control.stop:
                counts[STATUS] = DONE

    return advance


def crossings(pieces: Pieces, watch: Kernel, wrap: Wrap) -> Kernel:
    """The search for zeros of events within a step, on its dense output."""
    inside = pieces.inside

    @wrap.part
    def cross(t, y, end, w, h, g, counts, record, kinds, args):  # type: ignore[no-untyped-def]
        """Find zeros within the step, in order of time; give the share at which to stop, or 2."""
        state = np.empty(y.size)
        before, after, middle, shares = g[0], g[1], g[2], g[3]
        for part in range(PARTS):
            low = part / PARTS
            high = (part + 1) / PARTS
            if part == PARTS - 1:
                copy(end, state)
            else:
                counts[EVALUATIONS] += inside(high, t, y, w, h, state, args)
            watch(t + high * h, state, after, args)
            for e in range(kinds.shape[0]):
                shares[e] = math.inf
                rises = before[e] < 0.0 <= after[e]
                falls = before[e] > 0.0 >= after[e]
                if (rises and kinds[e, 0] >= 0) or (falls and kinds[e, 0] <= 0):
                    a, b = low, high
                    # Halving a share until nothing lies between its ends: 53 evaluations at most.
                    while True:
                        m = 0.5 * (a + b)
                        if m in (a, b):
                            break
                        counts[EVALUATIONS] += inside(m, t, y, w, h, state, args)
                        watch(t + m * h, state, middle, args)
                        if (middle[e] < 0.0) == (before[e] < 0.0) and middle[e] != 0.0:
                            a = m
                        else:
                            b = m
                    shares[e] = b
            copy(after, before)
            while True:
                e, share = 0, math.inf
                for other in range(kinds.shape[0]):
                    if shares[other] < share:
                        e, share = other, shares[other]
                if share == math.inf:
                    break
                shares[e] = math.inf
                counts[EVALUATIONS] += inside(share, t, y, w, h, state, args)
                record.found_t[counts[FOUND]] = t + share * h
                copy(state, record.found_y[counts[FOUND]])
                record.found_event[counts[FOUND]] = e
                counts[FOUND] += 1
                if kinds[e, 1]:
                    return share
        return 2.0

    return cross


def no_crossings(wrap: Wrap) -> Kernel:
    """The search without events: nothing to compile, nothing to find."""

    @wrap.part
    def cross(t, y, end, w, h, g, counts, record, kinds, args):  # type: ignore[no-untyped-def]
        return 2.0

    return cross


def samples(pieces: Pieces, wrap: Wrap) -> Kernel:
    """Dense output from the mesh alone: the step around each time is taken again."""
    begin, take, close, _, prepare, inside = pieces

    @wrap.loop
    def sample(times, places, mesh_t, mesh_y, w, out, args):  # type: ignore[no-untyped-def]
        n = mesh_y.shape[1]
        y, end = w[:n], w[n : 2 * n]
        current = -1
        for i in range(times.size):
            place = places[i]
            t = mesh_t[place]
            h = mesh_t[place + 1] - t
            if place != current:
                current = place
                copy(mesh_y[place], y)
                begin(t, y, w, args)
                take(t, y, end, w, h, args)
                copy(mesh_y[place + 1], end)
                close(t + h, end, w, args)
                prepare(t, y, end, w, h, args)
            inside((times[i] - t) / h, t, y, w, h, out[i], args)

    return sample
