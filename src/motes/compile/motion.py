"""Motion: the right-hand side and one step of one particle, from components and a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from motes.catalog import Component
from motes.catalog.source import fields_read
from motes.compile.surfaces import write_surfaces
from motes.compile.text import AXES, STATE, Call, Text, packed
from motes.control.constant import Constant, Setting
from motes.control.control import Control
from motes.errors import SceneError
from motes.tableau import (
    BackwardDifference,
    Implicit,
    Table,
)

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
            kernel = c.kernel("acceleration")
            if kernel is None:  # A flow, a relaxation, a limit.
                return address
            if set(STATE[3:]) & fields_read(kernel, 1, STATE):
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
    def eases_evenly(self) -> bool:
        """Whether the sum of the relaxations' rates is one number, everywhere and at any time.

        What follows from it is right in any case, and fast in this one.
        """
        for _, c in self.forces:
            if (kernel := c.kernel("relaxation")) is not None:
                read = fields_read(kernel, 1, (*STATE, *PARTICLE))
                seen = [self.traits[name][1] for name in read if name in self.traits]
                if read - set(self.traits) or not all(map(_fixed, (*c.values.values(), *seen))):
                    return False
        return self.relaxes

    @property
    def mortal(self) -> bool:
        """Whether anything retires particles."""
        return bool(self.retire)

    def needs(self) -> set[str]:
        """Columns that the components ask for."""
        parts = (*self.forces, *self.flows, *self.retire)
        return {need for _, component in parts for need in component.needs}


def write_right_hand_side(text: Text, motion: Motion) -> None:
    """Write `carried`, `pushed` and, where particles retire, `dies` into the text."""
    writer = _Writer(text, motion)
    writer.right_hand_side()
    if motion.mortal:
        writer.dies()


def write_potential(text: Text, motion: Motion) -> None:
    """Write `potential(x, ..., age, C, S, L, t)` [m2/s2], the sum of all forces that have one."""
    writer = _Writer(text, motion)
    writer.right_hand_side()  # Registers the system's columns in the order in which it keeps them.
    writer.potential()


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
            wanted = [
                f for f in self.motion.forces if not split or _stiff(f[1]) == (name == "pushed")
            ]
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


def _fixed(control: Control) -> bool:
    """Whether a value is the same for all particles at all times."""
    return isinstance(control, Constant | Setting)


def _stiff(force: Component) -> bool:
    """Whether a force is declared stiff."""
    return bool(force.values["stiff"].document())
