"""Motion: the right-hand side and one step of one particle, from components and a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from motes import integrate
from motes.catalog import Component
from motes.catalog.source import fields_read
from motes.compile import implicit, linearised
from motes.compile.surfaces import write_surfaces
from motes.compile.text import AXES, STATE, Call, Text, packed
from motes.control.control import Control
from motes.errors import SceneError
from motes.tableau import BackwardDifference, Explicit, Implicit, Nystrom, Rosenbrock, Splitting, Table

PARTICLE = {"age": "age", "id": "id", "obstacle": "obstacle"}
"""Columns of `q` that the engine computes itself."""

SEEN = """@inline
def seen(S, x, y, z):
    D = seen_solids(S)
    gap, _ = seen_near(D, x, y, z)
    e = F(1e-3) * (F(1.0) + abs(x) + abs(y) + abs(z))
    a, _ = seen_near(D, x + e, y - e, z - e)
    b, _ = seen_near(D, x - e, y - e, z + e)
    c, _ = seen_near(D, x - e, y + e, z - e)
    d, _ = seen_near(D, x + e, y + e, z + e)
    nx, ny, nz = a - b - c + d, c + d - a - b, b + d - a - c
    n = F(1.0) / sqrt(nx * nx + ny * ny + nz * nz + F(1e-30))
    return gap, n * nx, n * ny, n * nz
"""
"""Distance from the nearest solid, and its normal from four points around."""

NOTHING_SEEN = "@inline\ndef seen(S, x, y, z):\n    return F(1e9), F(0.0), F(0.0), F(1.0)\n"
"""Without solids the nearest is far below."""

KEPT = ("life", "mass")
"""Traits whose value at birth holds for life."""


@dataclass(frozen=True)
class Motion:
    """What moves a system: components with their addresses, traits, method."""

    forces: tuple[tuple[str, Component], ...]
    flows: tuple[tuple[str, Component], ...]
    retire: tuple[tuple[str, Component], ...]
    traits: dict[str, tuple[str, Control]]
    """Values of the system by name (life, mass, size, color): address and control."""
    method: Table
    solids: tuple[tuple[str, Component], ...] = ()
    """The scene's solids, for forces that need to see obstacles."""

    @property
    def limits(self) -> bool:
        """Whether anything limits the accelerations."""
        return any(c.kernel("limited") for _, c in self.forces)

    @property
    def inertial(self) -> bool:
        """Whether particles have a velocity of their own: all but those that flows alone carry."""
        return bool(self.forces) or not self.flows

    @property
    def split(self) -> bool:
        """Whether the method takes forces that are declared stiff implicitly, others explicitly."""
        pair = isinstance(self.method, Implicit) and bool(self.method.a_explicit)
        return pair and any(_stiff(c) for _, c in self.forces)

    @property
    def remembers(self) -> int:
        """Numbers that a particle keeps from step to step, for the method's sake."""
        return 7 if isinstance(self.method, BackwardDifference) else 0

    @property
    def follows_velocity(self) -> str:
        """Address of something because of which x'' depends on the velocity, or nothing."""
        for address, c in (*self.flows, *self.forces):
            if c.kernel("acceleration") is None:  # A flow, a relaxation, a limit.
                return address
            if set(STATE[3:]) & fields_read(c.kernel("acceleration"), 1, STATE):
                return address
            by_speed = [k for k, v in c.values.items() if getattr(v, "over", "") == "speed"]
            if by_speed:
                return f"{address}.{by_speed[0]}"
        return ""

    @property
    def relaxes(self) -> bool:
        """Whether any force is a relaxation."""
        return any(c.kernel("relaxation") for _, c in self.forces)

    @property
    def mortal(self) -> bool:
        """Whether anything retires particles."""
        return bool(self.retire)

    def needs(self) -> set[str]:
        """Columns that the components ask for."""
        parts = (*self.forces, *self.flows, *self.retire)
        return {need for _, component in parts for need in component.needs}


def write_motion(text: Text, motion: Motion) -> None:
    """Write `rate`, or `kick` and `drift`, and `advance` into the text.

    `advance(x, ..., age, C, S_0, ..., L, t_0, ..., h)` takes one particle through a step of length
    h; S_i and t_i are the scene's values and the time at the method's i-th stage.
    """
    writer, method = _Writer(text, motion), motion.method
    writer.right_hand_side()
    if isinstance(method, Explicit):
        writer.explicit(method)
    elif isinstance(method, Nystrom):
        writer.nystrom(method)
    elif isinstance(method, Splitting):
        writer.splitting(method)
    else:
        writer.implicit(method)
    if motion.mortal:
        writer.dies()


def write_potential(text: Text, motion: Motion) -> None:
    """Write `potential(x, ..., age, C, S, L, t)` [m2/s2], the sum of all forces that have one."""
    writer = _Writer(text, motion)
    writer.right_hand_side()  # Registers the system's columns in the order in which it keeps them.
    writer.potential()


def stage_times(method: Table) -> tuple[float, ...]:
    """Times at which the scene's values are needed, as shares of the step."""
    if isinstance(method, Explicit | Nystrom):
        return method.c
    if isinstance(method, Implicit):
        return tuple(method.c[i] for i in implicit.stages(method))
    if isinstance(method, Rosenbrock):
        return linearised.rosenbrock_times(method)
    if isinstance(method, BackwardDifference):
        return (1.0,)
    kicks = method.times
    middles = [(a + b) / 2 for a, b in pairwise(kicks)]
    return tuple(sorted({*kicks, *middles}))


class _Writer:
    """Writes one system's motion; `self.text` collects values, kernels and source."""

    def __init__(self, text: Text, motion: Motion) -> None:
        self.text, self.motion = text, motion
        self.particle = self._particle()

    def _particle(self) -> str:
        """An expression for `q`: position, velocity, and the columns that components need."""
        fields = {name: name for name in STATE}
        for need in sorted(self.motion.needs()):
            if need in PARTICLE:
                fields[need] = PARTICLE[need]
            else:
                address, control = self._trait(need)
                kept = need in KEPT
                fields[need] = packed(self.text.values.add(control, address, need, at_birth=kept))
        return self.text.record("Q", fields)

    def _trait(self, name: str) -> tuple[str, Control]:
        if name in self.motion.traits:
            return self.motion.traits[name]
        menu = ", ".join(sorted({*self.motion.traits, *PARTICLE}))
        raise SceneError(f'a component needs "{name}", which the system has not. It has {menu}.')

    def _preamble(self) -> str:
        """What curves over life and speed run over; unused lines cost nothing."""
        lines = ""
        if "life" in self.text.values.over:
            lines += f"    along_life = age / {packed(self._life())}\n"
        if "speed" in self.text.values.over:
            lines += "    speed = sqrt(vx * vx + vy * vy + vz * vz)\n"
        if "obstacle" in self.motion.needs():
            lines += "    obstacle = seen(S, x, y, z)\n"
        return lines

    def _life(self) -> list[str]:
        address, control = self._trait("life")
        return self.text.values.add(control, address, "life", at_birth=True)

    def _call(self, address: str, component: Component, kernel: str) -> Call:
        return self.text.call(component, address, kernel, f"{self.particle}, t")

    def _sum(self, parts: list[Call], vector: tuple[str, str, str]) -> str:
        """Source that adds up calls which give three numbers each into three names."""
        if not parts:
            return "".join(f"    {name} = F(0.0)\n" for name in vector)
        lines = f"    {', '.join(vector)} = {parts[0].source}\n"
        for call in parts[1:]:
            lines += f"    dx, dy, dz = {call.source}\n"
            lines += "".join(
                f"    {name} += {d}\n"
                for i, (name, d) in enumerate(zip(vector, ("dx", "dy", "dz"), strict=True))
                if not call.always_zero(i)
            )
        return lines

    def right_hand_side(self) -> None:
        """`carried`: the flows' velocity; `pushed`: acceleration and relaxation, all forces."""
        if "obstacle" in self.motion.needs():
            if self.motion.solids:
                write_surfaces(self.text, self.motion.solids, "seen_")
            self.text.add(SEEN if self.motion.solids else NOTHING_SEEN)
        arguments = ", ".join(STATE)
        calls = [self._call(address, c, "velocity") for address, c in self.motion.flows]
        split, parts = self.motion.split, dict[str, str]()
        for name in ("pushed", "mild") if split else ("pushed",):
            wanted = [f for f in self.motion.forces if not split or _stiff(f[1]) == (name == "pushed")]
            parts[name] = self._pushed(wanted)
        if "life" in self.text.values.over:
            self._life()
        head = f"({arguments}, age, C, S, L, t):\n{self._preamble()}"
        self.text.add(
            f"@inline\ndef carried{head}"
            + self._sum(calls, ("ux", "uy", "uz"))
            + "    return ux, uy, uz\n"
        )
        for name, body in parts.items():
            self.text.add(f"@inline\ndef {name}{head}{body}    return ax, ay, az, k, bx, by, bz\n")
        if self.motion.limits:
            self._limits(arguments)

    def _pushed(self, forces: Sequence[tuple[str, Component]]) -> str:
        """Source that adds up forces: an acceleration, and all relaxations as k v against b."""
        direct: list[Call] = []
        relaxing: list[Call] = []
        for address, c in forces:
            for name, found in (("acceleration", direct), ("relaxation", relaxing)):
                if c.kernel(name) is not None:
                    found.append(self._call(address, c, name))
                    break
        body = self._sum(direct, ("ax", "ay", "az"))
        body += "    k = F(0.0)\n    bx = F(0.0)\n    by = F(0.0)\n    bz = F(0.0)\n"
        for call in relaxing:
            body += f"    rate, ux, uy, uz = {call.source}\n    k += rate\n"
            body += "".join(
                f"    b{axis} += rate * u{axis}\n"
                for i, axis in enumerate(AXES, 1)
                if not call.always_zero(i)
            )
        return body

    def _limits(self, arguments: str) -> None:
        """`limited`: what the body can do of a sum of accelerations."""
        lines = self._preamble()
        for address, c in self.motion.forces:
            if c.kernel("limited") is not None:
                given = f"{self.particle}, t, ax, ay, az"
                lines += f"    ax, ay, az = {self.text.call(c, address, 'limited', given).source}\n"
        self.text.add(
            f"@inline\ndef limited({arguments}, age, C, S, L, t, ax, ay, az):\n"
            f"{lines}    return ax, ay, az\n"
        )

    def _slopes(self, i: int, state: tuple[str, ...], share: float) -> str:
        """Source for the slopes k of stage i at a state."""
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
            lines += self._slopes(i, names, method.c[i])
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
        if not self.motion.inertial:
            raise SceneError(
                "an implicit integrator is for forces; give a system that flows alone carry another"
            )
        precision, split = self.text.precision, self.motion.split
        if split and self.motion.limits:
            raise SceneError(
                "a limit bounds the sum of all forces: where it acts, none of them can be stiff alone"
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
            self.text.add(implicit.settle_text(precision))
            start = method if isinstance(method, Implicit) else integrate.method("backward_euler")
            assert isinstance(start, Implicit)
            self._advance(method, *implicit.advance_lines(start, split))
        if isinstance(method, BackwardDifference):
            self.text.add(implicit.PAST)
            past = ", ".join(f"p{k}" for k in range(self.motion.remembers))
            lines, ends = implicit.proceed_lines()
            head = f"({', '.join(STATE)}, {past}, age, C, S0, L, t0, h)"
            self.text.add(f"@inline\ndef proceed{head}:\n{lines}    return {', '.join(ends)}\n")

    def splitting(self, method: Splitting) -> None:
        """`advance` as kicks and drifts; relaxations are exact, so that no step explodes."""
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
        lines += f"    g = F({share!r}) * h\n"
        if self.motion.relaxes:
            lines += "    g *= phi1(r * g)\n"
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

    def potential(self) -> None:
        """`potential`: potential energy of a unit mass in all forces that have a potential."""
        having = [(a, c) for a, c in self.motion.forces if c.kernel("potential")]
        calls = [self._call(address, c, "potential").source for address, c in having]
        self.text.add(
            f"@inline\ndef potential({', '.join(STATE)}, age, C, S, L, t):\n{self._preamble()}"
            f"    return {' + '.join(calls) or 'F(0.0)'}\n"
        )

    def dies(self) -> None:
        """`dies`: whether any retirement applies."""
        calls = [self._call(address, c, "dies").source for address, c in self.motion.retire]
        self.text.add(
            f"@inline\ndef dies({', '.join(STATE)}, age, C, S, L, t):\n{self._preamble()}"
            f"    return {' | '.join(f'({c})' for c in calls)}\n"
        )


def _stiff(force: Component) -> bool:
    """Whether a force is declared stiff."""
    return bool(force.values["stiff"].document())


def _sum(start: str, weights: Sequence[float], scale: str, axis: str) -> str:
    """`start + (w_0 scale) a_0 + (w_1 scale) a_1 ...` without the zero terms."""
    terms = [f"F({float(w)!r}) * {scale} * a{axis}{j}" for j, w in enumerate(weights) if w != 0]
    return " + ".join([start, *terms])


def _combine(start: str, weights: tuple[float, ...], slope: str, axis: str) -> str:
    """`start + h * (w_0 slope_0 + w_1 slope_1 ...)` without the zero terms."""
    terms = [f"F({float(w)!r}) * {slope}{axis}{j}" for j, w in enumerate(weights) if w != 0]
    return f"{start} + h * ({' + '.join(terms)})" if terms else start
