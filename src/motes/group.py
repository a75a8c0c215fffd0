"""A group: systems that feel each other and therefore take every stage of a step together.

Advancing one system, or one particle, through a whole step before the next is a known way to lose
momentum and order. Here each stage is evaluated for the whole group before the next begins.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile import implicit
from motes.compile.pairs import Law
from motes.compile.staged import combine
from motes.errors import SceneError, SimulationError, likely
from motes.interact.arrange import Box
from motes.jit import blocks, share
from motes.nearby import Body, Lasting, Nearby
from motes.state import Particles
from motes.step import Interval, Stepper
from motes.tableau import Explicit, Implicit, Splitting

BLOCK = 1 << 16
"""Rows of one kernel call."""

ROUNDED = 1e3
"""Roundings that an implicit stage of a group may still be off where its iteration ended."""

Interactions = tuple[tuple[str, Component], ...]


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

    def store(self) -> None:
        """Write the state back into the particles' columns."""
        self.rows.position[:, : self.alive] = self.y[:3]
        self.rows.velocity[:, : self.alive] = self.y[3:]

    def each(self, name: str, *arguments: Any) -> None:
        """Run one of the system's staged kernels over all rows that were alive."""
        kernel = self.stepper.system.staged(name)
        columns, parts = (self.rows.birth, self.rows.columns), blocks(self.alive, BLOCK)
        share(lambda k: kernel(self.y, *columns, self.push, *arguments, *parts[k]), len(parts))

    def body(self, time: float) -> Body:
        """The system as laws of limited reach see it."""
        return Body(self.stepper, self.rows, self.alive, self.y[:3], self.y[3:], time)

    @property
    def K(self) -> Any:
        """What the system's kernels read."""
        return self.stepper.system.K_staged


class Group:
    """Steps systems that interact."""

    def __init__(
        self,
        steppers: dict[str, Stepper],
        interactions: Interactions,
        precision: str,
        strict: bool,
        periodic: Box,
    ) -> None:
        self.steppers = steppers
        self.interactions = tuple(pair for pair in interactions if _global(pair[1]))
        self._local = tuple(pair for pair in interactions if not _global(pair[1]))
        self._strict, self._periodic = strict, periodic
        self.nearby = self._nearby(precision)
        motions = [stepper.system.motion for stepper in steppers.values()]
        self.method = motions[0].method
        who = f"systems {', '.join(steppers)} interact"
        if any(motion.method is not self.method for motion in motions):
            raise SceneError(f"{who} and must have one integrator.")
        if not all(motion.inertial for motion in motions):
            raise SceneError(f"{who} and must have velocities: give them a force besides flows.")

    def _nearby(self, precision: str) -> Nearby:
        laws = []
        for address, part in self._local:
            targets = _named(part, "systems", self.steppers)
            sources = _named(part, "sources", targets)
            laws.append((Law(address, part, precision, self._strict), targets, sources))
        real = np.float32 if precision == "single" else np.float64
        return Nearby(laws, real, self._periodic)

    @cached_property
    def _measured(self) -> Nearby:
        """The laws of limited reach in double precision, to measure with."""
        return self._nearby("double")

    def step(self, systems: dict[str, Particles], interval: Interval, memory: Lasting) -> None:
        """Take all systems through one step, in place."""
        alive = {name: s.births(systems[name], interval) for name, s in self.steppers.items()}
        kept = {name: (alive[name], systems[name].deaths) for name in alive}
        if memory.kept != kept:
            memory.kept, memory.push = kept, None
        self.nearby.settle(self._bodies(systems, alive, interval.begin), memory)
        members = {name: self._member(name, systems[name], alive[name]) for name in alive}
        if isinstance(self.method, Splitting):
            self._split(members, interval, self.method, memory)
        elif isinstance(self.method, Implicit):
            self._implicit(members, interval, self.method, memory)
        else:
            self._runge_kutta(members, interval, self.method, memory)
        for name, stepper in self.steppers.items():
            if stepper.rebounds(systems[name], members[name].y, alive[name], interval):
                memory.push = None
            members[name].store()
            newborn = np.arange(alive[name], systems[name].count)
            stepper.exceptions(systems[name], newborn, interval)
            stepper.events()
            stepper.deaths(systems[name], np.arange(systems[name].count), interval)

    def _bodies(
        self, systems: dict[str, Particles], alive: dict[str, int], time: float
    ) -> dict[str, Body]:
        found = {}
        for name, stepper in self.steppers.items():
            rows, n = systems[name], alive[name]
            found[name] = Body(stepper, rows, n, rows.position[:, :n], rows.velocity[:, :n], time)
        return found

    def _member(self, name: str, rows: Particles, alive: int) -> _Member:
        y = np.concatenate([rows.position[:, :alive], rows.velocity[:, :alive]])
        return _Member(self.steppers[name], rows, alive, y, np.zeros((3, alive), rows.real))

    def _split(
        self, members: dict[str, _Member], interval: Interval, method: Splitting, memory: Lasting
    ) -> None:
        h = interval.length
        for kick, drift, place in zip(
            method.kicks, (*method.drifts, 0.0), method.times, strict=True
        ):
            time = _at(interval, place)
            if kick:
                self._interact(members, time, memory)
                for member in members.values():
                    member.each("kick", member.K, time, kick * h)
            if drift:
                memory.push = None
                for member in members.values():
                    member.each("drift", member.K, time, drift * h)

    def _runge_kutta(
        self, members: dict[str, _Member], interval: Interval, method: Explicit, memory: Lasting
    ) -> None:
        h, s = interval.length, method.stages
        bases = {name: m.y.copy() for name, m in members.items()}
        slopes = {name: np.zeros((s, *m.y.shape), m.y.dtype) for name, m in members.items()}
        for i, row in enumerate((*method.a, method.b)):
            _combine(members, bases, slopes, row, h)
            memory.push = None
            if i == s:
                return
            time = _at(interval, method.c[i])
            self._interact(members, time, memory)
            for name, member in members.items():
                member.each("slope", slopes[name][i], member.K, time)

    def _implicit(
        self, members: dict[str, _Member], interval: Interval, method: Implicit, memory: Lasting
    ) -> None:
        """Stages one by one; each row's own forces by Newton's method, pushes by iteration.

        That converges where h^2 times the stiffness between particles stays below 1; forces of
        one particle alone, and damping, may be as stiff as they like.
        """
        h = interval.length
        bases = {name: m.y.copy() for name, m in members.items()}
        places = implicit.stages(method)
        slopes = {n: np.zeros((len(places), *m.y.shape), m.y.dtype) for n, m in members.items()}
        for place, i in enumerate(places):
            _combine(members, bases, slopes, [method.a[i][j] for j in places[:place]], h)
            memory.push = None
            time, g = _at(interval, method.c[i]), method.a[i][i] * h
            if not g:
                self._interact(members, time, memory)
                for name, member in members.items():
                    member.each("slope", slopes[name][place], member.K, time)
                continue
            known = {name: m.y.copy() for name, m in members.items()}
            last = math.inf
            for _ in range(implicit.ITERATIONS):
                before = {name: m.y.copy() for name, m in members.items()}
                self._interact(members, time, memory)
                memory.push = None
                for name, member in members.items():
                    member.each("settled", known[name], member.K, time, g)
                change = max(_change(m.y, before[name]) for name, m in members.items())
                if change <= 1 or not change < last:
                    break
                last = change
            if not change <= ROUNDED:
                raise SimulationError(
                    f"the equations of a step at t = {interval.begin:.6g} s have no solution: the "
                    f"interaction is too stiff for its length, {h:g} s. Try a smaller step."
                )
            for name, m in members.items():
                slopes[name][place] = (m.y - known[name]) / m.y.dtype.type(g)
        _combine(members, bases, slopes, [method.b[i] for i in places], h)
        memory.push = None

    def _interact(self, members: dict[str, _Member], time: float, memory: Lasting) -> None:
        """Give every member the push of the interactions at a time.

        What was summed up last holds as long as nothing has moved: the end of one step of the
        leapfrog is the begin of the next.
        """
        if memory.push is None or memory.time != time or self.nearby.depends_on_velocity:
            memory.push = self._pushes(members, time, memory)
            memory.time = time
        for name, member in members.items():
            member.push = memory.push[name]

    def _pushes(
        self, members: dict[str, _Member], time: float, memory: Lasting
    ) -> dict[str, NDArray[Any]]:
        pushes = {name: np.zeros((3, m.alive), m.y.dtype) for name, m in members.items()}
        if self.interactions:
            bodies = [
                Bodies(name, m.y[:3], m.stepper.mass(m.rows, m.alive))
                for name, m in members.items()
            ]
            for _, interaction in self.interactions:
                chosen, p = _partners(interaction, bodies), _values(interaction, time)
                found = _kernel(interaction, "accelerations")(p, chosen)
                for body, push in zip(chosen, found, strict=True):
                    pushes[body.name] += push
        if self._local:
            near = {name: member.body(time) for name, member in members.items()}
            self.nearby.push(near, pushes, memory)
        return pushes

    def energy(self, systems: dict[str, Particles], time: float) -> float:
        """Potential energy [J] of the interactions that define one."""
        bodies = []
        for name, stepper in self.steppers.items():
            rows = systems[name]
            place = rows.position[:, : rows.count]
            bodies.append(Bodies(name, place, stepper.mass(rows, rows.count)))
        far = sum(
            float(_kernel(part, "energy")(_values(part, time), _partners(part, bodies)))
            for _, part in self.interactions
            if type(part).kernel("energy") is not None
        )
        return far + (self._measured.energy(self._all(systems, time)) if self._local else 0.0)

    def virial(self, systems: dict[str, Particles], time: float) -> NDArray[np.float64]:
        """Sums r_i f_j over the pairs of pair laws: xx, yy, zz, xy, xz, yz (6,) [J]."""
        if not self._local:
            return np.zeros(6)
        return self._measured.virial(self._all(systems, time))

    def _all(self, systems: dict[str, Particles], time: float) -> dict[str, Body]:
        return self._bodies(systems, {name: systems[name].count for name in self.steppers}, time)


def _at(interval: Interval, share: float) -> float:
    """A time within a step; its end is the next one's begin, to the last bit."""
    return interval.end if share == 1.0 else interval.begin + share * interval.length


def _global(interaction: Component) -> bool:
    return type(interaction).kernel("accelerations") is not None


def _combine(
    members: dict[str, _Member],
    bases: dict[str, NDArray[Any]],
    slopes: dict[str, NDArray[Any]],
    weights: Sequence[float],
    h: float,
) -> None:
    """Every member's state becomes base + h sum_j weights_j slopes_j."""
    for name, member in members.items():
        parts, real = blocks(member.alive, BLOCK), member.y.dtype.type
        row = np.array(weights, float).astype(real)
        arguments = (bases[name], slopes[name], row, real(h), member.y)
        share(lambda k, a=arguments, p=parts: combine(*a, *p[k]), len(parts))  # type: ignore[misc]


def _change(state: NDArray[Any], before: NDArray[Any]) -> float:
    """Largest change of positions and of velocities, in roundings of their largest number."""
    result = 0.0
    for block, old in ((state[:3], before[:3]), (state[3:], before[3:])):
        size = float(np.abs(block).max(initial=0.0)) * float(np.finfo(state.dtype).eps)
        moved = float(np.abs(block - old).max(initial=0.0))
        if moved:
            result = max(result, moved / size)
    return result if np.isfinite(state).all() else math.inf


def _kernel(interaction: Component, name: str) -> Callable[..., Any]:
    function = type(interaction).kernel(name)
    assert function is not None
    return function


def _named(part: Component, key: str, known: Iterable[str]) -> tuple[str, ...]:
    """The systems that an interaction names, or all that it could."""
    named = part.values[key].document()
    for name in named:
        if name not in known:
            raise SceneError(
                f'interaction "{part.name}": {key} names "{name}", which does not take part in it.'
                f"{likely(name, known)} There are: {', '.join(known)}."
            )
    return tuple(sorted(named or known))


def _partners(interaction: Component, bodies: list[Bodies]) -> list[Bodies]:
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
