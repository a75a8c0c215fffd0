"""The laws of limited reach of one group: neighbour lists that last, and sums over them.

Laws whose reaches are alike share lists. A list holds what is within the longest reach and a
margin, its skin; it is good until a particle has gone so far that the longest reach and both
particles' ways do not fit into it any more (Verlet, Physical Review 159 (1967) 98).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.pairs import FORCE, POTENTIAL, VIRIAL, Law
from motes.errors import SceneError, SimulationError
from motes.group.lasting import Body, Class, Kept, Lasting, Lists
from motes.group.renewal import bounds_in
from motes.group.sums import RECORDS, Packed, Places, Plan, Sums
from motes.group.swarm import Swarm
from motes.interact.arrange import Box, arrange, common_grid, wrapped
from motes.interact.clusters import RADIUS, WANTED, Room, cluster_lists, particle_lists
from motes.jit import BRIEF
from motes.repeat import Relay, Repeat

SELDOM = 8
"""Builds of lists from one order of rows to the next, where all rows are in a cache."""

ALIKE = 1.5
"""Ratio of reaches up to which laws share lists."""


class Nearby:
    """Evaluates a group's laws of limited reach."""

    def __init__(
        self,
        laws: Sequence[tuple[Law, tuple[str, ...], tuple[str, ...]]],
        real: type,
        periodic: Box,
    ) -> None:
        self.real, self.periodic = real, periodic
        self.laws = list(laws)
        self.classes: list[Class] = []
        gathering = [one for one in laws if not one[0].pairwise and not one[0].nearest]
        self.swarm = Swarm(gathering, real, periodic) if gathering else None
        if self.swarm is not None and not self.swarm.fits(0.0):
            self.swarm = None
        listed = [one for one in laws if self.swarm is None or one not in gathering]
        for one in sorted(listed, key=lambda one: -one[0].reach(0.0)):
            first = self.classes[-1].laws[0][0] if self.classes else None
            alike = first is not None and first.rebuild == one[0].rebuild
            if first is None or not alike or first.reach(0.0) > ALIKE * one[0].reach(0.0):
                self.classes.append(Class([]))
            self.classes[-1].laws.append(one)
        self._sums = Sums(real, self.periodic)
        self._plans: dict[int, Plan] = {}
        for law, _, _ in self.laws:
            if message := self._too_long(law, 0.0):
                raise SceneError(message)

    def _too_long(self, law: Law, time: float) -> str:
        reach, half = law.reach(time), self.periodic.shortest / 2
        if 0 < reach <= half:
            return ""
        if reach > half:
            return (
                f"{law.owner}: its reach {reach:g} m is more than half of the shortest period, "
                f"{half:g} m. Shorten the reach or widen [periodic]."
            )
        return f"{law.owner}: its reach {reach:g} m must be above 0 m."

    @cached_property
    def depends_on_velocity(self) -> bool:
        """Whether any law reads velocities."""
        return any(law.depends_on_velocity for law, _, _ in self.laws)

    def radius(self, time: float) -> float:
        """The widest radius of lists at a time [m]."""
        return max((part.radius(time, self.periodic) for part in self.classes), default=0.0)

    # ------------------------------------------------------------------ lists

    def settle(self, kept: Kept, begin: Callable[[], dict[str, Body]], memory: Lasting) -> None:
        """Bring rows into the order of cells, before the stages of a step.

        `kept` says which particles there are, `begin` where. Lists that do not hold any more, since
        some were born or have died, are built anew.
        """
        for name in sorted(memory.untidy):
            self._tidy(name, begin()[name], memory)
        memory.untidy = set()
        memory.lists = memory.lists or [None] * len(self.classes)
        memory.steps += 1
        for k in range(len(self.classes)):
            if not _holds(memory.lists[k], kept):
                self._build(k, begin(), memory, memory.steps - 1)
        moved: set[str] = set()
        for k, found in enumerate(memory.lists):
            if found is not None and not found.settled:
                self._reorder(k, set(found.arranged) - moved, begin(), memory)
                moved |= set(found.arranged)

    def _tidy(self, name: str, body: Body, memory: Lasting) -> None:
        """Move a swarm's rows into the order of its cells, unless lists order them."""
        if self.swarm is None or any(name in shared.systems for shared in self.classes):
            return
        order = self.swarm.order(body)
        body.rows.reorder(order, () if memory.push is None else memory.push[name])

    def _reorder(self, k: int, names: set[str], bodies: dict[str, Body], memory: Lasting) -> None:
        """Move rows into the order of one class's cells; all lists keep telling where they are."""
        mine = memory.lists[k]
        assert mine is not None
        for name in sorted(names):
            order = mine.arranged[name].order
            bodies[name].rows.reorder(order, () if memory.push is None else memory.push[name])
            itself = np.arange(order.size, dtype=np.int32)
            for i, other in enumerate(memory.lists):
                if other is not None and name in other.arranged:
                    there, moved_there = other.arranged[name], itself
                    if i != k:
                        place = np.empty_like(order)
                        place[order] = itself
                        moved_there = place[there.order]
                    there = there._replace(order=moved_there)
                    memory.lists[i] = replace(other, arranged={**other.arranged, name: there})
        settled = memory.lists[k]
        assert settled is not None
        memory.lists[k] = replace(settled, settled=True)

    def _build(self, k: int, bodies: dict[str, Body], memory: Lasting, step: int) -> None:
        """Build lists of a class.

        Few rows, which are in a cache wherever they are, are brought into the order of cells at
        some builds only.
        """
        rooms = {p: memory.rooms.setdefault((k, *p), Room()) for p in self.classes[k].pairs}
        built, kept = self.build(self.classes[k], bodies, rooms), memory.rooms.get((k,), {})
        marks = {}
        for name, arranged in built.arranged.items():
            if name in kept and len(kept[name]) == arranged.order.size:
                marks[name] = kept[name]  # To be written when lists of particles are chosen.
        few = sum(arranged.order.size for arranged in built.arranged.values()) <= BRIEF
        settled = few and memory.builds % SELDOM != 0
        memory.lists[k] = replace(built, step=step, marks=marks, settled=settled)
        memory.builds += 1

    def build(
        self, shared: Class, bodies: dict[str, Body], rooms: dict[Any, Room] | None = None
    ) -> Lists:
        """Lists of clusters for the laws of a class, of bodies as they are, in rooms by pair."""
        time = next(iter(bodies.values())).time
        radius = shared.radius(time, self.periodic)
        positions = {}
        for name in shared.systems:
            given: NDArray[Any] = bodies[name].position[:, : bodies[name].alive]
            position: NDArray[Any] = given.astype(self.real)
            if not np.isfinite(position).all():
                position = np.where(np.isfinite(position), position, 0.0).astype(position.dtype)
            wrapped(position, self.periodic)
            positions[name] = position
        cut = common_grid(list(positions.values()), radius, self.periodic)
        arranged = {n: arrange(p, cut, radius, self.periodic) for n, p in positions.items()}
        near = {}
        for a, b in shared.pairs:
            room = rooms[a, b] if rooms else Room()
            near[a, b] = cluster_lists(arranged[a], arranged[b], cut, radius, room)
        kept = {name: _kept(bodies[name]) for name in shared.systems}
        return Lists(radius, arranged, near, kept)

    def _chosen(
        self, shared: Class, found: Lists, packed: Packed, radius: float, rooms: dict[Any, Any]
    ) -> Lists:
        """Lists with those of particles, within a radius [m] of where they are now."""
        places = {name: packed[name][RECORDS] for name in shared.systems}
        bounds, short = bounds_in(rooms), {}
        bounds[[RADIUS, WANTED]] = radius, 1
        for (a, b), lists in found.near.items():
            room = rooms.setdefault((a, b), Room())
            short[a, b] = particle_lists(lists, places[a], places[b], bounds, a == b, room)
        marks = {}
        for name, place in places.items():
            here = place[: found.arranged[name].order.size]
            mark = rooms.get(name)
            if mark is None or mark.shape != here.shape:
                mark = rooms[name] = np.empty_like(here)
            np.copyto(mark, here)
            marks[name] = mark
        return replace(found, short=short, marks=marks, short_radius=radius)

    # ------------------------------------------------------------------ sums

    def push(
        self, bodies: dict[str, Body], pushes: dict[str, NDArray[Any]], memory: Lasting
    ) -> None:
        """Add the laws' accelerations (3, n) [m/s2] to pushes."""
        if self.swarm is not None:
            self.swarm.push(bodies, pushes, memory.untidy)
        memory.lists = memory.lists or [None] * len(self.classes)
        for k, shared in enumerate(self.classes):
            plan, found = self._plans.get(k), memory.lists[k]
            if plan is not None and found is not None and plan.fits(found, bodies, pushes):
                _, since = plan.places()
                if shared.good(found, since, plan.time, memory.steps):
                    plan.sums()
                    continue
            self._push(k, bodies, pushes, memory)

    def plans(
        self, bodies: dict[str, Body], pushes: dict[str, NDArray[Any]], memory: Lasting
    ) -> list[Callable[[Relay, NDArray[Any]], None]] | None:
        """What `push` would do until lists of clusters do not hold any more, to be appended to a
        relay with the numbers, by round, that stop it then. None where that cannot be said
        beforehand."""
        if self.swarm is not None or memory.untidy or len(memory.lists) != len(self.classes):
            return None
        found: list[Callable[[Relay, NDArray[Any]], None]] = []
        for k, (shared, lists) in enumerate(zip(self.classes, memory.lists, strict=True)):
            plan = self._plans.get(k)
            if plan is None or lists is None or not lists.settled or shared.every:
                return None
            if not plan.fits(lists, bodies, pushes):
                return None
            rooms = memory.rooms.setdefault((k,), {})
            found.append(partial(plan.relay, shared, rooms))
        return found

    def relayed(self, memory: Lasting, stopped: bool) -> None:
        """Take over what a relay has changed; if it has stopped, lists are known not to hold."""
        for k, plan in self._plans.items():
            lists = memory.lists[k]
            if lists is plan.lists:
                memory.lists[k] = plan.renewed()
        if stopped:
            self._plans.clear()

    def _push(
        self, k: int, bodies: dict[str, Body], pushes: dict[str, NDArray[Any]], memory: Lasting
    ) -> None:
        """Add what the laws of a class give, and keep how it was done while nothing changes."""
        shared, time = self.classes[k], next(iter(bodies.values())).time
        for law, _, _ in shared.laws:
            if message := self._too_long(law, time):
                raise SimulationError(message)
        found, places = self._current(k, bodies, memory, time)
        sums: list[Repeat] = []
        for law, targets, sources in shared.laws:
            sums += self._sums.pushing(law, targets, sources, time, found, places.packed, pushes)
        plan = Plan(found, places, sums, time, bodies, pushes)
        plan.sums()
        if places.lasting and all(law.lasting for law, _, _ in shared.laws):
            self._plans[k] = plan

    def _current(
        self, k: int, bodies: dict[str, Body], memory: Lasting, time: float
    ) -> tuple[Lists, Places]:
        """Lists of a class that miss no pair now, built or shortened anew where they must be."""
        shared, found = self.classes[k], memory.lists[k]
        radius = 0.0
        if found is not None and _holds(found, {name: _kept(bodies[name]) for name in bodies}):
            places = self._sums.places(shared, found, bodies)
            moved, since = places()
            if shared.good(found, since, time, memory.steps):
                return found, places
            radius = shared.short_radius(found, moved, time)
            if not found.short and (shared.every or not moved):
                radius = radius or found.radius  # They were built for this very place or step.
        if not radius:
            self._build(k, bodies, memory, memory.steps)
            found = memory.lists[k]
            assert found is not None
            places = self._sums.places(shared, found, bodies)
            places()
            radius = shared.short_radius(found, 0.0, time) or found.radius
        assert found is not None
        rooms = memory.rooms.setdefault((k,), {})
        found = memory.lists[k] = self._chosen(shared, found, places.packed, radius, rooms)
        return found, self._sums.places(shared, found, bodies)

    # ------------------------------------------------------------------ measures

    def energy(self, bodies: dict[str, Body]) -> float:
        """Potential energy [J] of the pair laws that have one: of two sources once."""
        return float(self._total(bodies, POTENTIAL)[0])

    def virial(self, bodies: dict[str, Body]) -> NDArray[np.float64]:
        """Sums of x f_x, y f_y, z f_z, x f_y, x f_z, y f_z over the pairs of pair laws (6,) [J]."""
        return np.asarray(self._total(bodies, VIRIAL))

    def _total(self, bodies: dict[str, Body], what: str) -> NDArray[np.float64]:
        total = np.zeros(1 if what == POTENTIAL else 6)
        for shared in self.classes:
            chosen = [
                one for one in shared.laws
                if type(one[0].part).kernel(FORCE if what == VIRIAL else what) is not None
            ]  # fmt: skip
            if not chosen or not any(bodies[name].alive for name in shared.systems):
                continue
            part = Class(chosen)
            found = self.build(part, bodies)
            places = self._sums.places(part, found, bodies)
            places()
            found = self._chosen(part, found, places.packed, found.radius, {})
            time = next(iter(bodies.values())).time
            for law, targets, sources in chosen:
                for target in targets:
                    sums = self._sums.summed(law, what, target, sources, time, found, places.packed)
                    share_ = 0.5 if target in sources else 1.0
                    total += share_ * sums.sum(axis=1, dtype=np.float64)
        return total


def _kept(body: Body) -> tuple[int, int]:
    return body.alive, body.rows.deaths


def _holds(found: Lists | None, kept: Kept) -> bool:
    """Whether lists are of the particles that there are."""
    return found is not None and found.kept.items() <= kept.items()
