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
"""Places in `clock`: time, next step, the last accepted step's error."""

EVALUATIONS, STEPS, REJECTED, STATUS, ASKED, MESH, FOUND, RETRY, PLACE = range(9)
"""Places in `counts`: work done, status; rows used of `asked`, mesh, found; flag; component."""

PARTS = 4
"""Parts of a step in which events look for a change of sign."""


class Pieces(NamedTuple):
    """One method around one right-hand side.

    The slopes k begin with the slope at the start of the step and end with that at its end; `rows`
    is space for dense output and errors.

    begin(t, y, k, args) -> evaluations: fills the first slope.
    take(t, y, k, end, h, args) -> evaluations, or less than 0 where no solution was found.
    close(t, end, k, args) -> evaluations: the slope at the end, the next step's first.
    error(t, y, end, k, h, rows, rtol, atol) -> norm of the estimated error, 1 is just
    allowed; leaves the estimate in rows[0].
    prepare(t, y, end, k, h, rows, args) -> evaluations, for dense output.
    inside(share, t, y, k, h, rows, out, args) -> evaluations: the state within the step.
    """

    begin: Kernel
    take: Kernel
    close: Kernel
    error: Kernel
    prepare: Kernel
    inside: Kernel


def partial_step(take: Kernel, wrap: Wrap) -> tuple[Kernel, Kernel]:
    """`prepare` and `inside` of a method without an interpolant: a shorter step of its own."""

    @wrap.part
    def prepare(t, y, end, k, h, rows, args):  # type: ignore[no-untyped-def]
        return 0

    @wrap.part
    def inside(share, t, y, k, h, rows, out, args):  # type: ignore[no-untyped-def]
        if share == 0.0:
            copy(y, out)
            return 0
        copy(k[0], rows[0])
        return abs(take(t, y, rows, out, share * h, args))

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


class Record(NamedTuple):
    """Where results go."""

    asked: Array
    """Times at which states are asked for, in the direction of the march."""
    answers: Array
    mesh_t: Array
    mesh_y: Array
    found_t: Array
    found_y: Array
    found_event: Any
    """Number of the event of each zero found."""


def steps(pieces: Pieces, watch: Kernel, cross: Kernel, wrap: Wrap) -> Kernel:
    """The loop over steps; `wrap` compiles it, or leaves it as it is."""
    begin, take, close, error, prepare, inside = pieces

    @wrap.part
    def first(t, y, end, k, rows, sign, control, atol, counts, args):  # type: ignore[no-untyped-def]
        """A first step from sizes of y, y', y'' (Hairer, Norsett and Wanner I, section II.4)."""
        span = min(abs(control.stop - control.start), control.largest)
        state = norm(y, y, y, control.rtol, atol)
        speed = norm(k[0], y, y, control.rtol, atol)
        trial = 1e-6
        if speed < math.inf and state >= 1e-5 and speed >= 1e-5:
            trial = 0.01 * state / speed
        trial = min(trial, span)
        add(y, sign * trial, k[0], end)
        counts[EVALUATIONS] += close(t + sign * trial, end, k, args)
        add(k[k.shape[0] - 1], -1.0, k[0], rows[0])
        most = max(speed, norm(rows[0], y, y, control.rtol, atol) / trial)
        if not most < math.inf:
            return trial
        better = max(1e-6, trial * 1e-3)
        if most > 1e-15:
            better = (0.01 / most) ** (1.0 / control.order)
        return min(100.0 * trial, better, span)

    @wrap.loop
    def advance(clock, counts, y, end, k, rows, g, control, record, atol, kinds, args):  # type: ignore[no-untyped-def]
        sign = 1.0 if control.stop >= control.start else -1.0
        events = kinds.shape[0]
        counts[MESH] = 0
        counts[FOUND] = 0
        if counts[STEPS] == 0 and counts[REJECTED] == 0:
            counts[EVALUATIONS] += begin(clock[TIME], y, k, args)
            watch(clock[TIME], y, g[0], args)
            if not control.fixed and clock[STEP] == 0.0:
                clock[STEP] = first(clock[TIME], y, end, k, rows, sign, control, atol, counts, args)
        while (
            counts[STATUS] == RUNNING
            and counts[MESH] < record.mesh_t.size
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
            done = take(t, y, k, end, h, args)
            if done < 0:
                counts[EVALUATIONS] -= done
                norm = math.inf
            else:
                counts[EVALUATIONS] += done
                counts[EVALUATIONS] += close(after, end, k, args)
                norm = 0.0 if control.fixed else error(t, y, end, k, h, rows, control.rtol, atol)
            if control.fixed:
                bad = first_infinite(end)
                if bad >= 0 or done < 0:
                    counts[PLACE] = bad
                    counts[STATUS] = INFINITE
                    break
            elif not norm <= 1.0:
                counts[REJECTED] += 1
                counts[RETRY] = 1
                shrink = 0.1 if not norm < math.inf else 0.9 * norm ** (-1.0 / control.order)
                clock[STEP] = h * max(0.1, shrink)
                if abs(clock[STEP]) <= 4e-16 * abs(t) or abs(clock[STEP]) < 1e-300:
                    counts[STATUS] = TOO_SMALL
                continue
            else:
                # Proportional and integral control: the last two errors choose the next step.
                norm = max(norm, 1e-10)
                grow = 0.9 * norm ** (-0.85 / control.order) * clock[ERROR] ** (0.2 / control.order)
                grow = min(10.0, max(0.2, grow))
                clock[STEP] = h * (min(1.0, grow) if counts[RETRY] else grow)
                clock[ERROR] = max(norm, 1e-4)
                counts[RETRY] = 0
            counts[STEPS] += 1

            reach = after
            if events or (
                counts[ASKED] < record.asked.size
                and sign * (record.asked[counts[ASKED]] - after) < 0.0
            ):
                counts[EVALUATIONS] += prepare(t, y, end, k, h, rows, args)
                share = cross(t, y, end, k, h, rows, g, counts, record, kinds, args)
                if share <= 1.0:
                    reach = t + share * h
                    counts[STATUS] = STOPPED
            while (
                counts[ASKED] < record.asked.size
                and sign * (record.asked[counts[ASKED]] - reach) <= 0.0
            ):
                answer = record.answers[counts[ASKED]]
                share = (record.asked[counts[ASKED]] - t) / h
                counts[ASKED] += 1
                if share == 1.0:
                    copy(end, answer)
                else:
                    counts[EVALUATIONS] += inside(share, t, y, k, h, rows, answer, args)
            if counts[STATUS] == STOPPED:
                inside((reach - t) / h, t, y, k, h, rows, end, args)
            clock[TIME] = reach
            copy(end, y)
            copy(k[k.shape[0] - 1], k[0])
            if record.mesh_y.shape[0]:
                copy(y, record.mesh_y[counts[MESH]])
            record.mesh_t[counts[MESH]] = reach
            counts[MESH] += 1
            if counts[STATUS] == RUNNING and reach == control.stop:
                counts[STATUS] = DONE

    return advance


def crossings(pieces: Pieces, watch: Kernel, wrap: Wrap) -> Kernel:
    """The search for zeros of events within a step, on its dense output."""
    inside = pieces.inside

    @wrap.part
    def cross(t, y, end, k, h, rows, g, counts, record, kinds, args):  # type: ignore[no-untyped-def]
        """Find zeros within the step, in order of time; give the share at which to stop, or 2."""
        state = np.empty(y.size)
        before, after, middle, shares = g[0], g[1], g[2], g[3]
        for part in range(PARTS):
            low = part / PARTS
            high = (part + 1) / PARTS
            if part == PARTS - 1:
                copy(end, state)
            else:
                counts[EVALUATIONS] += inside(high, t, y, k, h, rows, state, args)
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
                        counts[EVALUATIONS] += inside(m, t, y, k, h, rows, state, args)
                        watch(t + m * h, state, middle, args)
                        if (middle[e] < 0.0) == (before[e] < 0.0) and middle[e] != 0.0:
                            a = m
                        else:
                            b = m
                    shares[e] = b
            copy(after, before)
            while True:
                e = int(np.argmin(shares))
                share = shares[e]
                if share == math.inf:
                    break
                shares[e] = math.inf
                counts[EVALUATIONS] += inside(share, t, y, k, h, rows, state, args)
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
    def cross(t, y, end, k, h, rows, g, counts, record, kinds, args):  # type: ignore[no-untyped-def]
        return 2.0

    return cross


def samples(pieces: Pieces, wrap: Wrap) -> Kernel:
    """Dense output from the mesh alone: the step around each time is taken again."""
    begin, take, close, _, prepare, inside = pieces

    @wrap.loop
    def sample(times, places, mesh_t, mesh_y, out, k, rows, args):  # type: ignore[no-untyped-def]
        end = np.empty(mesh_y.shape[1])
        current = -1
        for i in range(times.size):
            place = places[i]
            t, y = mesh_t[place], mesh_y[place]
            h = mesh_t[place + 1] - t
            if place != current:
                current = place
                begin(t, y, k, args)
                take(t, y, k, end, h, args)
                copy(mesh_y[place + 1], end)
                close(t + h, end, k, args)
                prepare(t, y, end, k, h, rows, args)
            inside((times[i] - t) / h, t, y, k, h, rows, out[i], args)

    return sample
