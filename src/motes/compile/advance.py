"""One step of one particle, written out from a method's table."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from motes import integrate
from motes.compile import implicit, linearised
from motes.compile.motion import Motion, write_right_hand_side
from motes.compile.text import AXES, STATE, Text
from motes.errors import SceneError
from motes.tableau import (
    BackwardDifference,
    Explicit,
    Implicit,
    Nystrom,
    Rosenbrock,
    Splitting,
    Table,
)


def write_motion(text: Text, motion: Motion) -> None:
    """Write the right-hand side and `advance` into the text.

    `advance(x, ..., age, C, S_0, ..., L, t_0, ..., h)` takes one particle through a step of length
    h; S_i and t_i are the scene's values and the time at the method's i-th stage.
    """
    write_right_hand_side(text, motion)
    writer, method = _Writer(text, motion), motion.method
    if isinstance(method, Explicit):
        writer.explicit(method)
    elif isinstance(method, Nystrom):
        writer.nystrom(method)
    elif isinstance(method, Splitting):
        writer.splitting(method)
    else:
        writer.implicit(method)


def stage_times(method: Table) -> tuple[float, ...]:
    """Times at which the scene's values are needed, as shares of the step."""
    if isinstance(method, Explicit | Nystrom):
        return method.c
    if isinstance(method, Implicit):
        return tuple(method.c[i] for i in implicit.stages(method))
    if isinstance(method, Rosenbrock):
        return linearised.rosenbrock_times(method)
    if isinstance(method, BackwardDifference):
        return stage_times(_without_past())
    kicks = method.times
    middles = [(a + b) / 2 for a, b in pairwise(kicks)]
    return tuple(sorted({*kicks, *middles}))


def _without_past() -> Implicit:
    """What takes a particle through a step in which it is born or bounces, in place of bdf2."""
    found = integrate.method("sdirk2")
    assert isinstance(found, Implicit)
    return found


class _Writer:
    """Writes `advance`."""

    def __init__(self, text: Text, motion: Motion) -> None:
        self.text, self.motion = text, motion

    def _slopes(
        self, i: int, state: tuple[str, ...], share: float, row: Sequence[float] | None = None
    ) -> str:
        """Source for the slopes k of stage i at a state.

        With a row of the table, v_i = v + h sum_j A_ij a_j, and relaxations of one rate r go in as
        r v_i = r v + sum_j (h r A_ij) a_j: where no other force needs it, v_i is never computed.
        """
        call = f"({', '.join(state)}, age + F({share!r}) * h, C, S{i}, L, t{i})"
        velocity = state[3:]
        lines = f"    ux{i}, uy{i}, uz{i} = carried{call}\n" if self.motion.flows else ""
        if not self.motion.inertial:
            return lines
        for axis, v in zip(AXES, velocity, strict=True):
            flow = f" + u{axis}{i}" if self.motion.flows else ""
            lines += f"    k{axis}{i} = {v}{flow}\n"
        lines += f"    ax{i}, ay{i}, az{i}, r, bx, by, bz = pushed{call}\n"
        if self.motion.limits:
            a = f"ax{i}, ay{i}, az{i}"
            lines += f"    {a} = limited{call[:-1]}, {a})\n"
        if row is not None and self.motion.eases_evenly and not self.motion.limits:
            less = [-w for w in row]
            for axis in AXES:
                felt = f"a{axis}{i} + b{axis} - r * v{axis}"
                lines += f"    a{axis}{i} = {_sum(felt, less, 'h * r', axis)}\n"
            return lines
        for axis, v in zip(AXES, velocity, strict=True):
            lines += f"    a{axis}{i} += b{axis} - r * {v}\n"
        return lines

    def explicit(self, method: Explicit) -> None:
        """`advance` from a Butcher tableau."""
        if self.motion.inertial and not self.motion.flows:
            self._nystrom(method)
            return
        lines = ""
        slope = "k" if self.motion.inertial else "u"
        for i, row in enumerate(method.a):
            state = []
            for axis in AXES:
                state.append(_combine(axis, row, slope, axis))
            for axis in AXES:
                moved = row if self.motion.inertial else ()
                state.append(_combine(f"v{axis}", moved, "a", axis))
            names = tuple(f"{n}_{i}" for n in STATE)
            lines += "".join(f"    {n} = {e}\n" for n, e in zip(names, state, strict=True))
            lines += self._slopes(i, names, method.c[i])
        ends = [_combine(axis, method.b, slope, axis) for axis in AXES]
        if self.motion.inertial:
            ends += [_combine(f"v{axis}", method.b, "a", axis) for axis in AXES]
        else:
            ends += ["vx", "vy", "vz"]
        self._advance(method, lines, ends)

    def _nystrom(self, method: Explicit) -> None:
        """The same table where x' = v, with the velocities of its stages put in.

        x_i = x + c_i h v + h^2 sum_j (A A)_ij a_j and v_i = v + h sum_j A_ij a_j: fewer sums, and
        less that a SIMD loop must keep at hand. (Hairer, Norsett, Wanner I, section II.14.)
        """
        full = [[*row, *(0.0,) * (method.stages - len(row))] for row in method.a]
        table = np.array([*full, method.b])
        places, squares = (*method.c, 1.0), table @ table[:-1]
        lines, stages = "    h2 = h * h\n", []
        for place, row, square in zip(places, table, squares, strict=True):
            start = [f"{a} + F({float(place)!r}) * h * v{a}" if place else a for a in AXES]
            state = [_sum(s, square, "h2", a) for s, a in zip(start, AXES, strict=True)] + [
                _sum(f"v{a}", row, "h", a) for a in AXES
            ]
            stages.append(state)
        for i, state in enumerate(stages[:-1]):
            names = tuple(f"{n}_{i}" for n in STATE)
            lines += "".join(f"    {n} = {e}\n" for n, e in zip(names, state, strict=True))
            lines += self._slopes(i, names, method.c[i], method.a[i])
        self._advance(method, lines, stages[-1])

    def nystrom(self, method: Nystrom) -> None:
        """`advance` for accelerations that follow from place and time alone."""
        if guilty := self.motion.follows_velocity:
            raise SceneError(
                "nystrom5 is for forces that follow from place and time alone, and "
                f"{guilty} depends on the velocity. Choose rk4 or dopri5."
            )
        lines = "    h2 = h * h\n"
        for i, (c, row) in enumerate(zip(method.c, method.a, strict=True)):
            moved = [f"{a} + F({float(c)!r}) * h * v{a}" if c else a for a in AXES]
            state = [_sum(s, row, "h2", a) for s, a in zip(moved, AXES, strict=True)]
            names = tuple(f"{a}_{i}" for a in AXES)
            lines += "".join(f"    {n} = {e}\n" for n, e in zip(names, state, strict=True))
            lines += self._slopes(i, (*names, *STATE[3:]), float(c))
        ends = [_sum(f"{a} + h * v{a}", method.b_position, "h2", a) for a in AXES]
        self._advance(method, lines, ends + [_sum(f"v{a}", method.b, "h", a) for a in AXES])

    def implicit(self, method: Implicit | Rosenbrock | BackwardDifference) -> None:
        """`advance` with Newton's method for each stage, or for all together."""
        precision, split = self.text.precision, self.motion.split
        if split and self.motion.limits:
            raise SceneError(
                "a limit bounds the sum of all forces: where one acts, none can be stiff alone"
            )
        self.text.add(implicit.felt_text(self.motion.limits))
        if split:
            self.text.add(implicit.felt_text(False, "eased", "mild"))
        if isinstance(method, Rosenbrock):
            self.text.add(linearised.rosenbrock_text(method, precision))
            self._advance(method, *linearised.rosenbrock_lines(method))
        elif isinstance(method, Implicit) and not method.diagonal:
            self.text.add(linearised.together_text(method, precision))
            self._advance(method, *linearised.together_lines(method))
        else:
            source = linearised if self.motion.flows else implicit
            self.text.add(source.settle_text(precision))
            alone = method if isinstance(method, Implicit) else _without_past()
            self._advance(method, *implicit.advance_lines(alone, split))
        if isinstance(method, BackwardDifference):
            self.text.add(implicit.PAST)
            past = ", ".join(f"p{k}" for k in range(self.motion.remembers))
            lines, ends = implicit.proceed_lines()
            head = f"({', '.join(STATE)}, {past}, age, C, S0, S1, L, t0, t1, h)"
            self.text.add(f"@inline\ndef proceed{head}:\n{lines}    return {', '.join(ends)}\n")

    def splitting(self, method: Splitting) -> None:
        """`advance` as kicks and drifts; relaxations are exact, so that no step explodes."""
        if self.motion.flows and method.order > 2:
            raise SceneError(
                f"a splitting of order {method.order} is for forces alone: with the flow "
                f"{self.motion.flows[0][0]} it would be of order 2. Choose leapfrog or rk4."
            )
        places = stage_times(method)
        lines = ""
        for kick, drift, begin in zip(
            method.kicks, (*method.drifts, 0.0), method.times, strict=True
        ):
            if kick and self.motion.inertial:
                i = places.index(begin)
                lines += self._kick(kick, i, begin)
            if drift:
                lines += self._drift(drift, begin, places)
        self._advance(method, lines, list(STATE))

    def _kick(self, share: float, i: int, begin: float) -> str:
        call = f"({', '.join(STATE)}, age + F({begin!r}) * h, C, S{i}, L, t{i})"
        lines = f"    ax, ay, az, r, bx, by, bz = pushed{call}\n"
        if self.motion.limits:
            lines += f"    ax, ay, az = limited{call[:-1]}, ax, ay, az)\n"
        time = f"F({share!r}) * h"
        lines += f"    g = {f'damped_time(r, {time})' if self.motion.relaxes else time}\n"
        return lines + "".join(
            f"    v{axis} += g * (a{axis} + b{axis} - r * v{axis})\n" for axis in AXES
        )

    def _drift(self, share: float, begin: float, places: tuple[float, ...]) -> str:
        lines = f"    d = F({share!r}) * h\n"
        if not self.motion.flows:
            return lines + "".join(f"    {axis} += d * v{axis}\n" for axis in AXES)
        first, middle = places.index(begin), places.index(begin + share / 2)
        age = f"age + F({begin!r}) * h"
        own = {axis: f"v{axis} + " if self.motion.inertial else "" for axis in AXES}
        lines += f"    ux, uy, uz = carried({', '.join(STATE)}, {age}, C, S{first}, L, t{first})\n"
        lines += "".join(f"    m{a} = {a} + F(0.5) * d * ({own[a]}u{a})\n" for a in AXES)
        lines += f"    ux, uy, uz = carried(mx, my, mz, vx, vy, vz, {age} + F(0.5) * d, "
        lines += f"C, S{middle}, L, t{middle})\n"
        return lines + "".join(f"    {a} += d * ({own[a]}u{a})\n" for a in AXES)

    def _advance(self, method: Table, lines: str, ends: list[str]) -> None:
        stages = range(len(stage_times(method)))
        scene = ", ".join(f"S{i}" for i in stages)
        times = ", ".join(f"t{i}" for i in stages)
        self.text.add(
            f"@inline\ndef advance({', '.join(STATE)}, age, C, {scene}, L, {times}, h):\n"
            f"{lines}    return {', '.join(ends)}\n"
        )


def _sum(start: str, weights: Sequence[float], scale: str, axis: str) -> str:
    """`start + (w_0 scale) a_0 + (w_1 scale) a_1 ...` without the zero terms."""
    terms = [f"F({float(w)!r}) * {scale} * a{axis}{j}" for j, w in enumerate(weights) if w != 0]
    return " + ".join([start, *terms])


def _combine(start: str, weights: tuple[float, ...], slope: str, axis: str) -> str:
    """`start + h * (w_0 slope_0 + w_1 slope_1 ...)` without the zero terms."""
    terms = [f"F({float(w)!r}) * {slope}{axis}{j}" for j, w in enumerate(weights) if w != 0]
    return f"{start} + h * ({' + '.join(terms)})" if terms else start
