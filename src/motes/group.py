"""A group: systems that feel each other and therefore take every stage of a step together.

Advancing one system, or one particle, through a whole step before the next is a known way to lose
momentum and order. Here each stage is evaluated for the whole group before the next begins.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.capture import Captures
from motes.compile.staged import combine
from motes.constrain import Constraints, Ground
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
    """One system of the group during a step: state y (6, n), push (3, n) and mass (n,)."""

    stepper: Stepper
    rows: Particles
    alive: int
    y: NDArray[Any]
    push: NDArray[Any]
    mass: NDArray[Any]
    size: NDArray[Any]

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
        self,
        steppers: dict[str, Stepper],
        interactions: tuple[tuple[str, Component], ...],
        solids: tuple[tuple[str, Component], ...] = (),
    ) -> None:
        self.steppers = steppers
        self.interactions = _defining("accelerations", interactions)
        laws = _defining("velocities", interactions)
        self.constraints = Constraints(laws, Ground(solids if laws else ()))
        self.captures = Captures(_defining("captures", interactions))
        motions = [stepper.system.motion for stepper in steppers.values()]
        self.method = motions[0].method
        who = f"systems {', '.join(steppers)} interact"
        if any(motion.method is not self.method for motion in motions):
            raise SceneError(f"{who} and must have one integrator.")
        if laws and not isinstance(self.method, Splitting):
            raise SceneError(
                f'{who} by "{laws[0][1].name}", a law of velocities, which holds between kick and '
                'drift: choose integrator = "semi_implicit_euler" or another splitting method.'
            )
        if not all(motion.inertial for motion in motions):
            raise SceneError(f"{who} and must have velocities: give them a force besides flows.")
        if any(stepper.system.surfaces for stepper in steppers.values()):
            raise SceneError(
                f"{who}, and such systems do not bounce yet: write collides = false in the solids."
            )

    def step(self, systems: dict[str, Particles], interval: Interval) -> None:
        """Take all systems through one step, in place."""
        alive = {name: s.births(systems[name], interval) for name, s in self.steppers.items()}
        members = {name: self._member(name, systems[name], alive[name]) for name in alive}
        if isinstance(self.method, Splitting):
            self._split(members, interval, self.method)
        else:
            self._runge_kutta(members, interval, self.method)
        for name, stepper in self.steppers.items():
            members[name].store()
        seed = next(iter(self.steppers.values())).seed
        span = (interval.begin, interval.end)
        self.captures.find(systems, span, seed, alive, _values)
        for name, stepper in self.steppers.items():
            newborn = np.arange(alive[name], systems[name].count)
            stepper.exceptions(systems[name], newborn, interval)
            stepper.events()
            stepper.deaths(systems[name], interval, self.captures.rows(name))

    def _member(self, name: str, rows: Particles, alive: int) -> _Member:
        y = np.concatenate([rows.position[:, :alive], rows.velocity[:, :alive]])
        stepper = self.steppers[name]
        push, mass = np.zeros((3, alive), rows.real), stepper.mass(rows, alive)
        size = stepper.trait("size", rows, alive, 0.0) if self.constraints.laws else mass
        return _Member(stepper, rows, alive, y, push, mass, size)

    def _split(self, members: dict[str, _Member], interval: Interval, method: Splitting) -> None:
        h = interval.length
        before = {name: m.y[3:].copy() for name, m in members.items() if self.constraints.laws}
        for kick, drift, place in zip(
            method.kicks, (*method.drifts, 0.0), method.times, strict=True
        ):
            time = interval.begin + place * h
            if kick:
                self._interact(members, time)
                for member in members.values():
                    member.each("kick", member.K, time, kick * h)
            if drift:
                self.constraints.apply(members, before, time, drift * h, _partners, _values)
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
        bodies = [Bodies(name, m.y[:3], m.mass) for name, m in members.items()]
        for _, interaction in self.interactions:
            chosen, p = _partners(interaction, bodies), _values(interaction, time)
            pushes = _kernel(interaction, "accelerations")(p, chosen)
            for body, push in zip(chosen, pushes, strict=True):
                members[body.name].push += push

    def energy(self, systems: dict[str, Particles], time: float) -> float:
        """Potential energy [J] of the interactions that define one."""
        bodies = []
        for name, stepper in self.steppers.items():
            rows = systems[name]
            place = rows.position[:, : rows.count]
            bodies.append(Bodies(name, place, stepper.mass(rows, rows.count)))
        return sum(
            float(_kernel(part, "energy")(_values(part, time), _partners(part, bodies)))
            for _, part in self.interactions
            if type(part).kernel("energy") is not None
        )


def _defining(
    kernel: str, interactions: tuple[tuple[str, Component], ...]
) -> tuple[tuple[str, Component], ...]:
    """The interactions that define a kernel."""
    return tuple(pair for pair in interactions if type(pair[1]).kernel(kernel) is not None)


def _kernel(interaction: Component, name: str) -> Callable[..., Any]:
    function = type(interaction).kernel(name)
    assert function is not None
    return function


def _partners(interaction: Component, bodies: list[Any]) -> list[Any]:
    """The bodies that take part in an interaction."""
    named = interaction.values["systems"].document()
    return [body for body in bodies if not named or body.name in named]


def _values(interaction: Component, time: float) -> SimpleNamespace:
    """An interaction's parameters at a time."""
    return SimpleNamespace(
        **{key: _plain(interaction, key, time) for key in interaction.parameters}
    )


def _plain(component: Component, key: str, time: float) -> Any:
    control = component.values[key]
    if control.scope == "fixed":
        return control.document()
    value = control.at(time)
    return float(value[0]) if value.size == 1 else value
