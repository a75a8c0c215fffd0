"""A group: systems that feel each other and therefore take every stage of a step together.

Advancing one system, or one particle, through a whole step before the next is a known way to lose
momentum and order. Here each stage is evaluated for the whole group before the next begins.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.staged import combine
from motes.errors import SceneError
from motes.jit import blocks, share
from motes.state import Particles
from motes.step import Interval, Stepper
from motes.tableau import Explicit, Splitting

BLOCK = 1 << 16
"""Rows of one kernel call."""


@dataclass(frozen=True)
class Bodies:
    """What an interaction sees of one system: `position` (3, n) [m] and `mass` (n,) [kg]."""

    name: str
    position: NDArray[Any]
    mass: NDArray[Any]


@dataclass
class _Member:
    """One system of the group during a step: state y (6, n), slopes, and the push (3, n)."""

    stepper: Stepper
    rows: Particles
    alive: int
    y: NDArray[Any]
    push: NDArray[Any]

    def store(self) -> None:
        """Write the state back into the particles' columns."""
        self.rows.position[:, : self.alive] = self.y[:3]
        self.rows.velocity[:, : self.alive] = self.y[3:]

    def each(self, name: str, *arguments: Any) -> None:
        """Run one of the system's staged kernels over all rows that were alive."""
        kernel = self.stepper.system.staged(name)
        columns, parts = (self.rows.birth, self.rows.columns), blocks(self.alive, BLOCK)
        share(lambda k: kernel(self.y, *columns, self.push, *arguments, *parts[k]), len(parts))

    @property
    def K(self) -> Any:
        """What the system's kernels read."""
        return self.stepper.system.K_staged


class Group:
    """Steps systems that interact."""

    def __init__(
        self, steppers: dict[str, Stepper], interactions: tuple[tuple[str, Component], ...]
    ) -> None:
        self.steppers, self.interactions = steppers, interactions
        motions = [stepper.system.motion for stepper in steppers.values()]
        self.method = motions[0].method
        who = f"systems {', '.join(steppers)} interact"
        if any(motion.method is not self.method for motion in motions):
            raise SceneError(f"{who} and must have one integrator.")
        if not all(motion.inertial for motion in motions):
            raise SceneError(f"{who} and must have velocities: give them a force besides flows.")
        if any(stepper.system.surfaces for stepper in steppers.values()):
            raise SceneError(
                f"{who}, and such systems do not bounce yet: write collides = false in the solids."
            )

    def step(self, systems: dict[str, Particles], interval: Interval) -> None:
        """Take all systems through one step, in place."""
        alive = {name: systems[name].count for name in self.steppers}
        for name, stepper in self.steppers.items():
            stepper.births(systems[name], interval)
        members = {name: self._member(name, systems[name], alive[name]) for name in alive}
        if isinstance(self.method, Splitting):
            self._split(members, interval, self.method)
        else:
            self._runge_kutta(members, interval, self.method)
        nobody = np.zeros(0, np.int64)
        for name, stepper in self.steppers.items():
            members[name].store()
            stepper.exceptions(systems[name], nobody, alive[name], interval)
            stepper.events()
            stepper.deaths(systems[name], interval)

    def _member(self, name: str, rows: Particles, alive: int) -> _Member:
        y = np.concatenate([rows.position[:, :alive], rows.velocity[:, :alive]])
        return _Member(self.steppers[name], rows, alive, y, np.zeros((3, alive), rows.real))

    def _split(self, members: dict[str, _Member], interval: Interval, method: Splitting) -> None:
        h = interval.length
        for kick, drift, place in zip(
            method.kicks, (*method.drifts, 0.0), method.times, strict=True
        ):
            time = interval.begin + place * h
            if kick:
                self._interact(members, time)
                for member in members.values():
                    member.each("kick", member.K, time, kick * h)
            if drift:
                for member in members.values():
                    member.each("drift", member.K, time, drift * h)

    def _runge_kutta(
        self, members: dict[str, _Member], interval: Interval, method: Explicit
    ) -> None:
        h, s = interval.length, method.stages
        bases = {name: m.y.copy() for name, m in members.items()}
        slopes = {name: np.zeros((s, *m.y.shape), m.y.dtype) for name, m in members.items()}
        for i, row in enumerate((*method.a, method.b)):
            weights = np.array(row, float)
            for name, member in members.items():
                parts = blocks(member.alive, BLOCK)
                real = member.y.dtype.type
                arguments = (bases[name], slopes[name], weights.astype(real), real(h), member.y)
                share(lambda k, a=arguments, p=parts: combine(*a, *p[k]), len(parts))  # type: ignore[misc]
            if i == s:
                return
            time = interval.begin + method.c[i] * h
            self._interact(members, time)
            for name, member in members.items():
                member.each("slope", slopes[name][i], member.K, time)

    def _interact(self, members: dict[str, _Member], time: float) -> None:
        """Fill every member's push with what the interactions give at a time."""
        for member in members.values():
            member.push[:] = 0
        for _, interaction in self.interactions:
            named = interaction.values["systems"].document()
            chosen = [m for name, m in members.items() if not named or name in named]
            bodies = [Bodies(m.rows.name, m.y[:3], m.stepper.mass(m.rows, m.alive)) for m in chosen]
            p = SimpleNamespace(
                **{key: _plain(interaction, key, time) for key in interaction.parameters}
            )
            for member, push in zip(
                chosen, type(interaction).kernel("accelerations")(p, bodies), strict=True
            ):
                member.push += push


def _plain(component: Component, key: str, time: float) -> Any:
    control = component.values[key]
    if control.scope == "fixed":
        return control.document()
    value = control.at(time)
    return float(value[0]) if value.size == 1 else value
