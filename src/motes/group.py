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

from motes.capture import Captures
from motes.catalog import Component
from motes.compile import implicit
from motes.compile.pairs import Law
from motes.compile.staged import combine
from motes.constrain import Constraints, Ground
from motes.errors import SceneError, SimulationError, likely
from motes.interact.arrange import Box
from motes.jit import blocks, share
from motes.nearby import Body, Lasting, Nearby
from motes.state import Particles
from motes.step import Interval, Stepper
from motes.tableau import Explicit, Implicit, Splitting

BLOCK = 1 << 14
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


@dataclass(frozen=True)
class Movers:
    """What an exchange sees of one system and may change: its rows' positions and velocities."""

    name: str
    position: NDArray[Any]
    """(3, n) [m]"""
    velocity: NDArray[Any]
    """(3, n) [m/s]"""
    mass: NDArray[Any]
    """(n,) [kg]"""
    size: NDArray[Any]
    """(n,) diameters [m]"""
    ids: NDArray[np.uint64]


@dataclass(frozen=True)
class Occasion:
    """When an exchange happens: at the end of a step of a length [s], in a box, at an address."""

    length: float
    step: int
    address: str
    seed: int
    periodic: Box


@dataclass
class _Member:
    """One system of the group during a step: state y (6, capacity) and push (3, n)."""

    stepper: Stepper
    rows: Particles
    alive: int
    y: NDArray[Any]
    """The particles' own positions and velocities, or a copy where a flight has to be kept."""
    push: NDArray[Any]

    def each(self, name: str, *arguments: Any) -> None:
        """Run one of the system's staged kernels over all rows that were alive."""
        kernel = self.stepper.system.staged(name)
        columns, parts = (self.rows.birth, self.rows.columns), blocks(self.alive, BLOCK)
        share(lambda k: kernel(self.y, *columns, self.push, *arguments, *parts[k]), len(parts))

    def body(self, time: float) -> Body:
        """The system as laws of limited reach see it."""
        x, v = self.y[:3, : self.alive], self.y[3:, : self.alive]
        return Body(self.stepper, self.rows, self.alive, x, v, time)

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
        solids: Interactions = (),
    ) -> None:
        self.steppers = steppers
        self.interactions = _having(interactions, "accelerations")
        self.exchanges = _having(interactions, "exchange")
        self._local = _having(interactions, "reach")
        laws = _having(interactions, "velocities")
        self.constraints = Constraints(laws, Ground(solids if laws else ()))
        self.captures = Captures(_having(interactions, "captures"))
        self._strict, self._periodic = strict, periodic
        self.nearby = self._nearby(precision)
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

    def _nearby(self, precision: str) -> Nearby:
        laws = []
        for address, part in self._local:
            partners = _named(part, "systems", self.steppers)
            targets = _named(part, "targets", self.steppers, partners)
            sources = _named(part, "sources", self.steppers, partners)
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
            if stepper.system.surfaces is not None:
                if stepper.rebounds(systems[name], members[name].y, alive[name], interval):
                    memory.push = None
                systems[name].motion[:, : alive[name]] = members[name].y
        for address, part in self.exchanges:
            self._exchange(address, part, members, interval, memory)
        seed = next(iter(self.steppers.values())).seed
        span = (interval.begin, interval.end)
        self.captures.find(systems, span, seed, alive, _values)
        for name, stepper in self.steppers.items():
            newborn = np.arange(alive[name], systems[name].count)
            stepper.exceptions(systems[name], newborn, interval)
            stepper.events()
            rows, caught = systems[name], self.captures.rows(name)
            stepper.deaths(rows, np.arange(rows.count), interval, caught)

    def _bodies(
        self, systems: dict[str, Particles], alive: dict[str, int], time: float
    ) -> dict[str, Body]:
        found = {}
        for name, stepper in self.steppers.items():
            rows, n = systems[name], alive[name]
            found[name] = Body(stepper, rows, n, rows.position[:, :n], rows.velocity[:, :n], time)
        return found

    def _member(self, name: str, rows: Particles, alive: int) -> _Member:
        stepper = self.steppers[name]
        y = rows.motion if stepper.system.surfaces is None else rows.motion[:, :alive].copy()
        return _Member(stepper, rows, alive, y, np.zeros((3, 0), rows.real))

    def _split(
        self, members: dict[str, _Member], interval: Interval, method: Splitting, memory: Lasting
    ) -> None:
        h = interval.length
        before = {
            name: m.y[3:, : m.alive].copy() for name, m in members.items() if self.constraints.laws
        }
        for kick, drift, place in zip(
            method.kicks, (*method.drifts, 0.0), method.times, strict=True
        ):
            time = _at(interval, place)
            if kick:
                self._interact(members, time, memory)
                for member in members.values():
                    member.each("kick", member.K, time, kick * h)
            if drift:
                self.constraints.apply(members, before, time, drift * h, _partners, _values)
                memory.push = None
                for member in members.values():
                    member.each("drift", member.K, time, drift * h)

    def _runge_kutta(
        self, members: dict[str, _Member], interval: Interval, method: Explicit, memory: Lasting
    ) -> None:
        h, s = interval.length, method.stages
        bases = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
        slopes = {name: np.zeros((s, 6, m.alive), m.y.dtype) for name, m in members.items()}
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
        bases = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
        places = implicit.stages(method)
        slopes = {n: np.zeros((len(places), 6, m.alive), m.y.dtype) for n, m in members.items()}
        for place, i in enumerate(places):
            _combine(members, bases, slopes, [method.a[i][j] for j in places[:place]], h)
            memory.push = None
            time, g = _at(interval, method.c[i]), method.a[i][i] * h
            if not g:
                self._interact(members, time, memory)
                for name, member in members.items():
                    member.each("slope", slopes[name][place], member.K, time)
                continue
            known = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
            last = math.inf
            for _ in range(implicit.ITERATIONS):
                before = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
                self._interact(members, time, memory)
                memory.push = None
                for name, member in members.items():
                    member.each("settled", known[name], member.K, time, g)
                change = max(
                    _change(m.y[:, : m.alive], before[name]) for name, m in members.items()
                )
                if change <= 1 or not change < last:
                    break
                last = change
            if not change <= ROUNDED:
                raise SimulationError(
                    f"the equations of a step at t = {interval.begin:.6g} s have no solution: the "
                    f"interaction is too stiff for its length, {h:g} s. Try a smaller step."
                )
            for name, m in members.items():
                slopes[name][place] = (m.y[:, : m.alive] - known[name]) / m.y.dtype.type(g)
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
                Bodies(
                    name, np.ascontiguousarray(m.y[:3, : m.alive]), m.stepper.mass(m.rows, m.alive)
                )
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

    def _exchange(
        self,
        address: str,
        part: Component,
        members: dict[str, _Member],
        interval: Interval,
        memory: Lasting,
    ) -> None:
        """Let particles exchange motion at a step's end."""
        p, chosen = _values(part, interval.end), _named(part, "systems", members)
        movers, seed = [], 0
        for name in chosen:
            member = members[name]
            rows, n, stepper = member.rows, member.alive, member.stepper
            mass, seed = stepper.mass(rows, n), int(stepper.seed)
            size = stepper.trait("size", rows, n, interval.end)
            x, v = rows.position[:, :n], rows.velocity[:, :n]
            movers.append(Movers(name, x, v, mass, size, rows.ids[:n]))
        when = Occasion(interval.length, memory.steps, address, seed, self._periodic)
        if _kernel(part, "exchange")(p, movers, when):
            memory.push = None

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


def _having(interactions: Interactions, kernel: str) -> Interactions:
    """The interactions that define a kernel."""
    return tuple(pair for pair in interactions if type(pair[1]).kernel(kernel) is not None)


def named_systems(interaction: Component) -> set[str]:
    """All systems that an interaction links; none where it names nobody, which means all."""
    named = set(interaction.values["systems"].document())
    others = (interaction.values[key].document() for key in ("sources", "hunters")
              if key in interaction.values)  # fmt: skip
    return named.union(*others) if named else named


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


def _named(
    part: Component, key: str, known: Iterable[str], otherwise: Iterable[str] = ()
) -> tuple[str, ...]:
    """The systems that an interaction names, or others, or all that it could."""
    named = part.values[key].document()
    for name in named:
        if name not in known:
            raise SceneError(
                f'interaction "{part.name}": {key} names "{name}", which does not take part in it.'
                f"{likely(name, known)} There are: {', '.join(known)}."
            )
    return tuple(sorted(named or otherwise or known))


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
