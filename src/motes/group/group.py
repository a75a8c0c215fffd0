"""A group: systems that feel each other and therefore take every stage of a step together.

Advancing one system, or one particle, through a whole step before the next is a known way to lose
momentum and order. Here each stage is evaluated for the whole group before the next begins.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.pairs import Law
from motes.errors import SceneError
from motes.group.capture import Captures
from motes.group.constrain import Constraints, Ground
from motes.group.contacts import Contacts, Planes
from motes.group.glide import Glide
from motes.group.implicit import backward_difference, one_by_one, together
from motes.group.lasting import Body, Lasting
from motes.group.members import Bodies, Member, Movers, Occasion
from motes.group.methods import nystrom, runge_kutta, split
from motes.group.nearby import Nearby
from motes.group.partners import Interactions, having, kernel, named, partners, values
from motes.group.rosenbrock import rosenbrock
from motes.interact.arrange import Box
from motes.state import Particles
from motes.step import Interval, Stepper
from motes.tableau import BackwardDifference, Explicit, Nystrom, Rosenbrock, Splitting

NOTHING: dict[Any, NDArray[Any]] = {
    real: np.zeros((3, 0), real) for real in (np.float32, np.float64)
}
"""No push, by type of numbers."""


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
        self.interactions = having(interactions, "accelerations")
        self.exchanges = having(interactions, "exchange")
        self._local = having(interactions, "reach")
        laws = having(interactions, "velocities")
        self.constraints = Constraints(laws, Ground(solids if laws else ()))
        self.captures = Captures(having(interactions, "captures"), steppers)
        self.contacts = Contacts(solids if self.exchanges else ())
        self._strict, self._periodic = strict, periodic
        self._members: dict[str, Member] = {}
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
        if isinstance(self.method, Nystrom) and self.nearby.depends_on_velocity:
            raise SceneError(
                f"{who} by a law that depends on velocities, and nystrom5 is for forces that "
                "follow from place and time alone. Choose rk4 or dopri5."
            )
        if isinstance(self.method, Rosenbrock) and any(motion.limits for motion in motions):
            raise SceneError(
                f"{who}, and a limit bounds the sum of all forces, which rodas4 takes apart. "
                "Choose radau5 or kencarp4."
            )
        if not all(motion.inertial for motion in motions):
            raise SceneError(f"{who} and must have velocities: give them a force besides flows.")
        self.glide = Glide(self)

    def _nearby(self, precision: str) -> Nearby:
        laws = []
        for address, part in self._local:
            partners = named(part, "systems", self.steppers)
            targets = named(part, "targets", self.steppers, partners)
            sources = named(part, "sources", self.steppers, partners)
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
            memory.kept, memory.push, memory.trees = kept, None, {}
        begin = partial(self._bodies, systems, alive, interval.begin)
        self.nearby.settle(kept, begin, memory)
        members = {name: self.member(name, systems[name], alive[name], memory) for name in alive}
        self._integrate(members, interval, memory)
        for name, stepper in self.steppers.items():
            if stepper.system.surfaces is not None:
                if stepper.rebounds(systems[name], members[name].y, alive[name], interval):
                    memory.push = None
                systems[name].motion[:, : alive[name]] = members[name].y[:, : alive[name]]
        for address, part in self.exchanges:
            self._exchange(address, part, members, interval, memory)
        seed = next(iter(self.steppers.values())).seed
        span = (interval.begin, interval.end)
        self.captures.find(systems, span, seed, alive, values)
        for name, stepper in self.steppers.items():
            rows = systems[name]
            if rows.count > alive[name]:
                stepper.exceptions(rows, np.arange(alive[name], rows.count), interval)
            stepper.events()
            caught = self.captures.rows(name)
            if caught.size or stepper.system.motion.mortal:
                stepper.deaths(rows, np.arange(rows.count), interval, caught)

    def _integrate(self, members: dict[str, Member], interval: Interval, memory: Lasting) -> None:
        """Take the states of all members from the step's begin to its end."""
        method = self.method
        if isinstance(method, Splitting):
            split(self, members, interval, method, memory)
        elif isinstance(method, Explicit):
            runge_kutta(self, members, interval, method, memory)
        elif isinstance(method, Nystrom):
            nystrom(self, members, interval, method, memory)
        elif isinstance(method, BackwardDifference):
            backward_difference(self, members, interval, method, memory)
        elif isinstance(method, Rosenbrock):
            rosenbrock(self, members, interval, method, memory)
        else:
            (one_by_one if method.diagonal else together)(self, members, interval, method, memory)

    def _bodies(
        self, systems: dict[str, Particles], alive: dict[str, int], time: float
    ) -> dict[str, Body]:
        found = {}
        for name, stepper in self.steppers.items():
            rows = systems[name]
            found[name] = Body(stepper, rows, alive[name], rows.motion, time)
        return found

    def member(self, name: str, rows: Particles, alive: int, memory: Lasting) -> Member:
        """A system as it takes part in a step, with the push that was last given to it."""
        stepper = self.steppers[name]
        flies = stepper.system.surfaces is not None
        member, push = self._members.get(name), memory.pushes.get(name, NOTHING[rows.real])
        if member is None or not member.fits(rows, alive):
            y = np.empty_like(rows.motion) if flies else rows.motion
            member = self._members[name] = Member(stepper, rows, alive, y, push)
        if flies:
            member.y[:, :alive] = rows.motion[:, :alive]
        member.push = push
        return member

    def interact(self, members: dict[str, Member], time: float, memory: Lasting) -> None:
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
        self, members: dict[str, Member], time: float, memory: Lasting
    ) -> dict[str, NDArray[Any]]:
        pushes = {name: memory.pushed(name, m.alive, m.y.dtype) for name, m in members.items()}
        if self.interactions:
            bodies = []
            for name, m in members.items():
                x, mass = np.ascontiguousarray(m.y[:3, : m.alive]), m.stepper.mass(m.rows, m.alive)
                births = partial(m.stepper.numbers, m.rows, m.alive, time)
                bodies.append(Bodies(name, x, mass, births, memory.trees))
            for _, interaction in self.interactions:
                chosen, p = partners(interaction, bodies), values(interaction, time)
                found = kernel(interaction, "accelerations")(p, chosen)
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
        members: dict[str, Member],
        interval: Interval,
        memory: Lasting,
    ) -> None:
        """Let particles exchange motion at a step's end."""
        p, chosen = values(part, interval.end), named(part, "systems", members)
        movers, seed = [], 0
        for name in chosen:
            member = members[name]
            rows, n, stepper = member.rows, member.alive, member.stepper
            mass, seed = stepper.mass(rows, n), int(stepper.seed)
            size = stepper.trait("size", rows, n, interval.end)
            x, v = rows.position[:, :n], rows.velocity[:, :n]
            movers.append(Movers(name, x, v, mass, size, rows.ids[:n]))

        def planes(position: NDArray[Any], reach: float) -> Planes:
            return self.contacts.near(position, reach, interval.end)

        when = Occasion(interval.length, memory.steps, address, seed, self._periodic, planes)
        if kernel(part, "exchange")(p, movers, when):
            memory.push = None
            for name in chosen:
                members[name].rows.forget(slice(0, members[name].alive))

    def energy(self, systems: dict[str, Particles], time: float) -> float:
        """Potential energy [J] of the interactions that define one."""
        bodies = []
        for name, stepper in self.steppers.items():
            rows = systems[name]
            place = rows.position[:, : rows.count]
            bodies.append(Bodies(name, place, stepper.mass(rows, rows.count)))
        far = sum(
            float(kernel(part, "energy")(values(part, time), partners(part, bodies)))
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
