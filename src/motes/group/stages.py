"""Implicit stages of a whole group: its own forces row by row, the pushes between all by iteration.

A stage's unknowns are the pushes P, accelerations of all particles by all others. With them given,
every row solves its own equations however stiff its own forces are (`compile/implicit.py`), and the
states that result cause pushes again: P = respond(P). Where the pushes are mild that settles by
itself in a few rounds; else Newton's method takes over (`krylov.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.implicit import ITERATIONS
from motes.errors import SimulationError
from motes.group.krylov import Vector, newton
from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.step import Interval

if TYPE_CHECKING:
    from motes.group.group import Group

ROUNDED = 1e3
"""Roundings that a stage of a group may still be off where its iteration ended."""

SETTLED = 10.0
"""Roundings below which what no longer comes nearer has settled."""

MILD = 0.5
"""Factor by which a round must come nearer, or Newton's method takes over."""

Members = dict[str, Member]


def unsolved(interval: Interval) -> SimulationError:
    """What to say where no solution was found."""
    return SimulationError(
        f"the equations of a step at t = {interval.begin:.6g} s have no solution: the interaction "
        f"is too stiff for its length, {interval.length:g} s. Try a smaller step."
    )


class Stages:
    """Stages that are solved at once, one or, in fully implicit methods, all of a step.

    `solve(k)` brings every member's state to that of stage k, from the pushes that `pushes` holds
    for it; `begin` does what comes before the first.
    """

    def __init__(
        self,
        group: Group,
        members: Members,
        memory: Lasting,
        times: list[float],
        begin: Callable[[], None],
        solve: Callable[[int], None],
        lever: float,
    ) -> None:
        self.group, self.members, self.memory = group, members, memory
        self.times, self.begin, self.solve, self.lever = times, begin, solve, lever
        self.pushes = {
            name: np.zeros((len(times), 3, m.alive), m.y.dtype) for name, m in members.items()
        }
        self._rate = 0.0
        self._before = self._states = [self._now()]

    def settle(self, interval: Interval) -> None:
        """Solve. Raises SimulationError where there is no solution."""
        x, change, last = self._first(), math.inf, math.inf
        for _ in range(ITERATIONS):
            found = self.respond(x)
            change = self.change()
            if change <= 1 or not change < MILD * last:
                break
            x, last = found, change
        if not change <= SETTLED:
            x = np.zeros_like(x)  # As if nobody pushed: pushes of stiff laws would lead far astray.
            self._rate = 1 / math.sqrt(self.lever)
            change = newton(self.respond, x, self._shift, self.change)
        if not change <= ROUNDED:
            raise unsolved(interval)

    def respond(self, x: Vector) -> Vector:
        """The pushes that the states cause which pushes x lead to."""
        at, found = 0, []
        for pushes in self.pushes.values():
            pushes[:] = x[at : at + pushes.size].reshape(pushes.shape)
            at += pushes.size
        self.begin()
        self._states = []
        later = {name: np.empty_like(pushes) for name, pushes in self.pushes.items()}
        for k, time in enumerate(self.times):
            self.solve(k)
            self._states.append(self._now())
            self.memory.push = None
            self.group.interact(self.members, time, self.memory)
            for name, member in self.members.items():
                later[name][k] = member.push
        self.memory.push = None
        found = [later[name].ravel() for name in self.pushes]
        return np.concatenate(found).astype(float)

    def change(self) -> float:
        """How far the last states are from those before, in roundings of the largest number."""
        before, self._before = self._before, self._states
        pairs = zip(self._states, before, strict=False)
        return max(_change(new[n], old[n], self._rate) for new, old in pairs for n in new)

    def _first(self) -> Vector:
        """The pushes where everybody is now, for each stage."""
        self.group.interact(self.members, self.times[0], self.memory)
        self.memory.push = None
        stages = len(self.times)
        parts = [np.repeat(m.push[None], stages, 0).ravel() for m in self.members.values()]
        return np.concatenate(parts).astype(float)

    def _shift(self, v: Vector) -> float:
        """A way along v on which positions change in half of their digits."""
        size = max(
            float(np.abs(m.y[:3, : m.alive]).max(initial=0.0)) for m in self.members.values()
        )
        rounding = float(np.finfo(next(iter(self.members.values())).y.dtype).eps)
        return math.sqrt(rounding) * (size or 1.0) / (self.lever * float(np.abs(v).max()))

    def _now(self) -> dict[str, NDArray[Any]]:
        return {name: m.y[:, : m.alive].copy() for name, m in self.members.items()}


def _change(state: NDArray[Any], before: NDArray[Any], rate: float) -> float:
    """Largest change of positions and of velocities, in roundings of their largest number.

    Where a law is stiff, velocities are no surer than positions times a rate [1/s].
    """
    result, place = 0.0, 0.0
    for block, old in ((state[:3], before[:3]), (state[3:], before[3:])):
        size = max(float(np.abs(b).max(initial=0.0)) for b in (block, old))
        size, place = max(size, rate * place), size
        moved = float(np.abs(block - old).max(initial=0.0))
        if moved:
            result = max(result, moved / (size * float(np.finfo(state.dtype).eps)))
    return result if np.isfinite(state).all() else math.inf
