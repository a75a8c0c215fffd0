"""Rosenbrock methods for a group: linear systems in place of iterations.

A stage solves (1 / (gamma h) - J) u = r. With the change q that u makes to the pushes given, every
row solves its own part with its own matrix; q = J_pushes u closes the system, by GMRES, with the
derivative of the pushes along u as a central difference.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.linearised import DRIFT, DRIFT_TIMES
from motes.errors import SimulationError
from motes.group.krylov import Vector, gmres, norm
from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.group.methods import at, combined
from motes.group.stages import unsolved
from motes.step import Interval
from motes.tableau import Rosenbrock

if TYPE_CHECKING:
    from motes.group.group import Group

FAR = 1e-2
"""What a linear system may be off at most, as a share of its right side."""

COARSE = 1e-10
"""Rounding from which on differences are coarse."""

STIFF = 1.1
"""Factor by which an interaction may answer back in a step, where differences are coarse: no
iteration takes away what is wrong with the matrix, and errors grow from step to step."""

Members = dict[str, Member]
Blocks = dict[str, NDArray[Any]]


def rosenbrock(
    group: Group, members: Members, interval: Interval, method: Rosenbrock, memory: Lasting
) -> None:
    """Stages of a Rosenbrock table."""
    h = interval.length
    bases = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
    ways = {name: np.zeros((method.stages, *b.shape), b.dtype) for name, b in bases.items()}
    solve = _Solve(group, members, interval, memory, bases)

    def slopes(time: float) -> Blocks:
        group.interact(members, time, memory)
        memory.push = None
        found = {name: np.empty_like(b) for name, b in bases.items()}
        for name, m in members.items():
            m.each("slope", found[name], m.K, numbers=(time,))
        return found

    memory.push = None
    at_times = [slopes(at(interval, share)) for share in DRIFT_TIMES]
    for i, row in enumerate(method.a):
        combined(members, bases, ways, row, 1.0)
        right = slopes(at(interval, method.c[i])) if i else at_times[0]
        total = {}
        for name, f in right.items():
            past = np.tensordot(np.array(method.d[i], f.dtype) / f.dtype.type(h), ways[name][:i], 1)
            drift = sum(f.dtype.type(w) * s[name] for w, s in zip(DRIFT, at_times, strict=True))
            total[name] = f + past + f.dtype.type(method.g[i]) * drift
        for name, way in solve(total).items():
            ways[name][i] = way
    combined(members, bases, ways, method.b, 1.0)


class _Solve:
    """Solves the linear system of a step at its begin."""

    def __init__(
        self, group: Group, members: Members, interval: Interval, memory: Lasting, bases: Blocks
    ) -> None:
        self.members, self.interval, self.bases = members, interval, bases
        self.interact: Callable[[], None] = partial(group.interact, members, interval.begin, memory)
        self.memory = memory
        self.rounding = float(np.finfo(next(iter(bases.values())).dtype).eps)
        self.sizes = [
            max(float(np.abs(b[k : k + 3]).max(initial=0.0)) for b in bases.values())
            for k in (0, 3)
        ]

    def __call__(self, right: Blocks) -> Blocks:
        still = {name: np.zeros_like(b) for name, b in right.items()}
        quiet = np.zeros(3 * sum(b.shape[1] for b in right.values()))

        def rest(q: Vector) -> Vector:
            return q - self.caused(self.led(still, q))

        first = self.caused(self.led(right, quiet))
        q, left = gmres(rest, first, self.rounding**0.6)
        if not left < FAR:
            raise unsolved(self.interval)
        if self.rounding > COARSE and norm(first) > STIFF * norm(q):
            raise SimulationError(
                f"at t = {self.interval.begin:.6g} s the interaction is too stiff for a Rosenbrock "
                "method in single precision, whose differences are too coarse for its matrix. Try "
                'precision = "double", or backward_euler or radau5.'
            )
        return self.led(right, q)

    def led(self, right: Blocks, q: Vector) -> Blocks:
        """The u of every row, whose pushes change by q."""
        found, first = {}, 0
        for name, m in self.members.items():
            m.y[:, : m.alive] = self.bases[name]
            last = first + 3 * m.alive
            m.push = q[first:last].reshape(3, m.alive).astype(m.y.dtype)
            found[name], first = np.empty_like(right[name]), last
            m.each(
                "led",
                right[name],
                found[name],
                m.K,
                numbers=(self.interval.begin, self.interval.length),
            )
        return found

    def caused(self, ways: Blocks) -> Vector:
        """How the pushes change along u: their derivative times u."""
        x, v = self.sizes[0] or 1.0, self.sizes[1] or self.sizes[0] / self.interval.length or 1.0
        far = max(
            max(
                float(np.abs(u[:3]).max(initial=0.0)) / x, float(np.abs(u[3:]).max(initial=0.0)) / v
            )
            for u in ways.values()
        )
        step: float = self.rounding**0.4 / (far or 1.0)
        found = []
        for sign in (1, -1):
            for name, m in self.members.items():
                m.y[:, : m.alive] = self.bases[name] + m.y.dtype.type(sign * step) * ways[name]
            self.memory.push = None
            self.interact()
            self.memory.push = None
            pushes = np.concatenate([m.push.ravel() for m in self.members.values()]).astype(float)
            found.append(pushes)
        return np.asarray((found[0] - found[1]) / (2 * step))
