"""A simulation: a scene, compiled, with its state; it steps, it gives frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motes.appearance import Look
from motes.catalog import Component, find
from motes.compile.motion import Motion
from motes.compile.system import CompiledSystem
from motes.diagnose import explain_infinity
from motes.emission import Clock
from motes.errors import SceneError, SimulationError, likely
from motes.frame import Frame
from motes.group import Group, joined, linked
from motes.group.capture import CAPTURE
from motes.group.glide import TOGETHER as GLIDE
from motes.group.lasting import Lasting
from motes.integrate import method
from motes.interact.arrange import Box, wrap, wrapped
from motes.jit import BRIEF, even_blocks
from motes.philox import channel
from motes.record.energy import Matter, Measures, measure
from motes.repeat import Repeat, Repeats
from motes.scene.address import component_address
from motes.scene.document import Scene, System, a_scene
from motes.state import Particles, State
from motes.step import Interval, Stepper
from motes.view import View

TOGETHER = 16
"""Most steps that a block of particles goes through while it is in a cache."""

EDGE = 1e-6
"""A time this close to a step's end, in steps, counts as the step's end."""


class Simulation:
    """A scene that runs.

    The time is step * number of steps, exactly; a frame between two steps is a throwaway partial
    step, so that it changes nothing.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = a_scene(scene)
        self._lead_in = round(scene.prewarm / scene.step)
        self.start = -self._lead_in * scene.step
        """Scene time at which the first step begins: 0 less the steps nearest to the prewarm."""
        self._periodic = Box(
            np.array(scene.periodic.low, float), np.array(scene.periodic.size, float)
        )
        self._steppers = {s.name: self._stepper(s) for s in scene.systems}
        self._groups = self._grouped()
        grouped = {name for group in self._groups for name in group.steppers}
        self._alone = {name: name not in grouped for name in sorted(self._steppers)}
        self._calls = Repeats()
        self._looks = {s.name: Look(s) for s in scene.systems}
        self._systems = {s.name: s for s in scene.systems}
        real = np.float32 if scene.precision == "single" else np.float64
        self._closed = bool(self._periodic.size.any())
        self._edges = self._periodic.low.astype(real), self._periodic.size.astype(real)
        self._state = State(0, {}, [Lasting() for _ in self._groups])
        for system in scene.systems:
            compiled = self._steppers[system.name].system
            widths = [(c.address, c.width) for c in compiled.columns]
            moves = compiled.motion.inertial
            self._state.systems[system.name] = Particles(
                system.name, real, moves, widths, compiled.motion.remembers
            )
        self._torn = False
        self.work = 0
        """Particle-steps taken so far."""
        self._run(self._lead_in, None)

    def _stepper(self, system: System) -> Stepper:
        scene = self.scene

        def addressed(*lists: Any) -> tuple[tuple[str, Component], ...]:
            found = [
                (component_address(owner, c), c)
                for owner, components in zip((None, system), lists, strict=True)
                for c in components
            ]
            return tuple(sorted(found, key=lambda pair: pair[0]))  # Sums run in order of names.

        traits = {
            name: (f"{system.name}.{name}", control)
            for name in ("life", "mass", "size", "color")
            if (control := getattr(system, name)) is not None
        }
        retire = list(system.retire)
        if system.life is not None and not any(r.type == "lifetime" for r in retire):
            retire.append(find("retire", "lifetime")(name="lifetime"))
        motion = Motion(
            addressed(scene.force, system.force),
            addressed(scene.flow, system.flow),
            tuple((component_address(system, r), r) for r in retire),
            traits,
            method(system.integrator or scene.integrator),
            addressed(scene.solid, ()),
        )
        emitters = addressed((), system.emit)
        compiled = CompiledSystem(
            motion, addressed(scene.solid, ()), emitters, scene.precision, scene.mode == "strict"
        )
        clocks = [Clock(address, emitter, self.start) for address, emitter in emitters]
        return Stepper(compiled, clocks, scene.seed, system.capacity)

    def _grouped(self) -> list[Group]:
        """Groups of systems that interact, directly or through others."""
        links = linked(self.scene.interact, list(self._steppers))
        return [
            Group(
                {name: self._steppers[name] for name in sorted(group)},
                tuple(
                    (component_address(None, part), part)
                    for part, link in zip(self.scene.interact, links, strict=True)
                    if link & group
                ),
                self.scene.precision,
                self.scene.mode == "strict",
                self._periodic,
                tuple((component_address(None, part), part) for part in self.scene.solid),
            )
            for group in joined(links)
        ]

    @property
    def steps(self) -> int:
        """Steps taken since time 0."""
        return self._state.number - self._lead_in

    @property
    def time(self) -> float:
        """Scene time [s]: the number of steps times their length."""
        return self.steps * self.scene.step

    @property
    def count(self) -> int:
        """Particles alive, all systems together."""
        return sum(p.count for p in self._state.systems.values())

    @property
    def impacts(self) -> int:
        """Impacts on solids so far."""
        return sum(s.impacts for s in self._steppers.values())

    @property
    def captures(self) -> NDArray[Any]:
        """Captures so far, by time: structured, time [s], hunter and prey (ids), place [m]."""
        kept = [part for group in self._groups for part in group.captures.kept]
        return np.sort(np.concatenate([np.zeros(0, CAPTURE), *kept]), order=("time", "prey"))

    def __getitem__(self, name: str) -> View:
        if name not in self._systems:
            menu = ", ".join(self._systems)
            hint = f"{likely(name, self._systems)} There are: {menu}."
            raise SceneError(f'no system "{name}".{hint}', source="")
        return View(
            self._state.systems[name],
            self._steppers[name].system,
            self._looks[name],
            self.time,
        )

    def digest(self) -> str:
        """One hash of the whole state: equal digests mean equal bits."""
        return self._state.digest()

    def measure(self) -> Measures:
        """Energy, momentum, angular momentum and virial ratio of all particles, now.

        Particles that flows alone carry have no motion of their own and do not count.
        """
        systems, potential = self._state.systems, 0.0
        matter = []
        for name, rows in systems.items():
            stepper, n = self._steppers[name], rows.count
            if rows.moves:
                mass = stepper.mass(rows, n)
                matter.append(Matter(rows.position[:, :n], rows.velocity[:, :n], mass))
                potential += float(mass @ stepper.system.potential(rows, self.time))
        potential += sum(group.energy(systems, self.time) for group in self._groups)
        return measure(self.time, matter, potential)

    def virial(self) -> NDArray[np.float64]:
        """Sums r_a f_b (3, 3) [J] over all pairs of the pair laws, now; W is its trace."""
        xx, yy, zz, xy, xz, yz = sum(
            (group.virial(self._state.systems, self.time) for group in self._groups), np.zeros(6)
        )
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def listed_radius(self) -> float:
        """Radius of the widest neighbour lists [m], 0 where no law has a reach."""
        return max((group.nearby.radius(self.time) for group in self._groups), default=0.0)

    def place(self, system: str, position: ArrayLike, velocity: ArrayLike = 0.0) -> None:
        """Add particles at given places, now, to those that emitters make.

        `position`: (n, 3) [m]. `velocity`: (n, 3), or one for all (3,) [m/s]. Raises SceneError if
        there is no such system or its particles have values that are drawn at birth, ValueError for
        arrays of other shapes.
        """
        self[system]
        rows = self._state.systems[system]
        if rows.widths:
            drawn = ", ".join(address for address, _ in rows.widths)
            raise SceneError(f'system "{system}": placed particles cannot draw {drawn}.')
        x = np.asarray(position, float)
        if x.ndim != 2 or x.shape[1] != 3:
            raise ValueError(f"position must be (n, 3), not {x.shape}")
        v = np.broadcast_to(np.asarray(velocity, float), x.shape)
        rows.append(x.T, v.T, self.time, np.uint64(channel(f"{system}.place")))
        wrapped(rows.position, self._periodic, rows.count)

    def step(self) -> None:
        """Take one step."""
        self.run(steps=1)

    def run(
        self,
        *,
        until: float | None = None,
        steps: int | None = None,
        progress: Callable[[Simulation], None] | None = None,
        checked: bool = True,
    ) -> None:
        """Run for a number of steps, or to the last step that does not go beyond a time [s].

        `progress` is called after every step. Raises SimulationError when a particle became
        infinite, with the likely cause, unless the result is not to be `checked`.
        """
        if (until is None) == (steps is None):
            raise ValueError("run takes either steps or until, such as run(until=2.0)")
        if until is not None:
            if not math.isfinite(until):
                raise ValueError(f"until must be finite, not {until}")
            steps = max(self._steps_before(until) - self.steps, 0)
        assert steps is not None
        if steps < 0:
            raise ValueError(f"steps must be at least 0, not {steps}")
        self._run(steps, progress)
        if checked:
            self.check()

    def _run(self, steps: int, progress: Callable[[Simulation], None] | None) -> None:
        last = self.steps + steps
        while self.steps < last:
            with self._whole():
                if progress is None and self._glides(last - self.steps):
                    continue
                begin, end = self._step_begin(self._state), self._step_begin(self._state, 1)
                self._advance(self._state, Interval(begin, end))
            if progress is not None:
                progress(self)

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """A step, or several, after which there is no next one should it be broken off."""
        self._refuse_torn()
        self._torn = True
        yield
        self._torn = False

    def _refuse_torn(self) -> None:
        if self._torn:
            raise SimulationError(
                f"a step after t = {self.time:.6g} s was broken off, and its particles are between "
                "two states. Make the Simulation anew."
            )

    def _glides(self, steps: int) -> bool:
        """Take several steps at once, at most so many, if all particles only move in them."""
        state, steps = self._state, min(steps, GLIDE if self._groups else TOGETHER)
        if steps < 2 or not self._may_glide:
            return False
        begin, length = state.number - self._lead_in, self.scene.step
        times = [(begin + k) * length for k in range(steps + 1)]
        span = times[0], times[-1], self.scene.step
        if not all(s.undisturbed(state.systems[n], *span) for n, s in self._steppers.items()):
            return False
        if self._groups:
            memory, closing = state.memories[0], self._wraps(state) if self._closed else []
            assert isinstance(memory, Lasting)
            steps = self._groups[0].glide(state.systems, times, memory, closing)
        else:
            intervals = [Interval(*pair) for pair in pairwise(times)]
            for name, stepper in self._steppers.items():
                stepper.glide(state.systems[name], intervals)
        self.work += steps * self.count
        state.number += steps
        return steps > 0

    @property
    def _may_glide(self) -> bool:
        """Whether steps may be taken together: of systems that do not interact, in open space, or
        of one group."""
        if not self._groups:
            return not self._closed
        one = len(self._groups) == 1 and not any(self._alone.values())
        return one and self._groups[0].glide.possible

    def _wraps(self, state: State) -> list[Repeat]:
        """Calls that take all particles back into the periodic box."""
        return [
            self._calls(
                ("wrap", name), wrap, (rows.position, *self._edges), even_blocks(rows.count),
                rows.count <= BRIEF,
            )
            for name, rows in state.systems.items()
        ]  # fmt: skip

    def _step_begin(self, state: State, ahead: int = 0) -> float:
        """Time at which a state's next step begins, or a later one."""
        return (state.number + ahead - self._lead_in) * self.scene.step

    def _advance(self, state: State, interval: Interval) -> None:
        for name, alone in self._alone.items():
            self.work += state.systems[name].count
            if alone:
                self._steppers[name].step(state.systems[name], interval)
        for group, memory in zip(self._groups, state.memories, strict=True):
            assert isinstance(memory, Lasting)
            group.step(state.systems, interval, memory)
        if self._closed:
            for calls in self._wraps(state):
                calls()
        state.number += 1

    def _steps_before(self, time: float) -> int:
        return math.floor(time / self.scene.step + EDGE)

    def frame(self, time: float | None = None, index: int = 0) -> Frame:
        """What is to be seen at a time [s], by default now; the simulation stays where it is."""
        self._refuse_torn()
        state, at = self._state, self.time
        if time is not None:
            ahead = time - self.time
            if ahead < -EDGE * self.scene.step:
                raise ValueError(f"time {time} s lies before the simulation's, {self.time} s")
            if ahead > EDGE * self.scene.step:
                state, at = self._glimpse(time)
        systems = {}
        for name, particles in state.systems.items():
            view = View(particles, self._steppers[name].system, self._looks[name], at)
            systems[name] = view.drawn()
        return Frame(time=at if time is None else time, index=index, systems=systems)

    def _glimpse(self, time: float) -> tuple[State, float]:
        """A copy of the state, taken to a time beyond it by steps and a partial one."""
        state = self._state.copy()
        impacts = {name: s.impacts for name, s in self._steppers.items()}
        captures = [len(group.captures.kept) for group in self._groups]
        while (ahead := time - self._step_begin(state)) > EDGE * self.scene.step:
            whole = ahead > (1 - EDGE) * self.scene.step
            end = self._step_begin(state, 1) if whole else time
            self._advance(state, Interval(self._step_begin(state), end))
        for name, stepper in self._steppers.items():
            stepper.impacts = impacts[name]
        for group, length in zip(self._groups, captures, strict=True):
            del group.captures.kept[length:]
        return state, time

    def frames(self, first: int | None = None, last: int | None = None) -> Iterator[Frame]:
        """Frames of the film, every 1/fps seconds from 1 at time 0, up to the duration.

        Without `first` they begin with the first frame that is not before the simulation's time.
        """
        fps = float(self.scene.film.fps)
        if first is None:
            first = 1 + math.ceil(self.time * fps - EDGE)
        if last is None:
            last = self.frame_count
        for index in range(first, last + 1):
            time = (index - 1) / fps
            self._run(max(self._steps_before(time) - self.steps, 0), None)
            self.check()
            yield self.frame(time, index)

    @property
    def frame_count(self) -> int:
        """Frames of the whole film."""
        return max(1, math.floor(self.scene.duration * float(self.scene.film.fps) + EDGE))

    def check(self) -> None:
        """Raise SimulationError when a particle became infinite or not a number."""
        for name, particles in self._state.systems.items():
            row = particles.first_not_finite()
            if row is not None:
                raise SimulationError(explain_infinity(self, name, row))

    def forces(self, system: str) -> tuple[tuple[str, Component], ...]:
        """Addresses and components of the forces on a system, in the order of their sum."""
        return self._steppers[system].system.motion.forces
