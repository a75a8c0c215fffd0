"""The time-stepping methods, a stage of all members before the next.

A method changes the members' states `y` and drops what the group remembers of the last push
wherever something moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.compile import implicit
from motes.compile.staged import combine
from motes.errors import SimulationError
from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.group.partners import partners, values
from motes.jit import even_blocks, share
from motes.step import Interval
from motes.tableau import Explicit, Implicit, Splitting

if TYPE_CHECKING:
    from motes.group.group import Group

ROUNDED = 1e3
"""Roundings that an implicit stage of a group may still be off where its iteration ended."""


def split(
    group: Group, members: dict[str, Member], interval: Interval, method: Splitting, memory: Lasting
) -> None:
    """Kicks and drifts in turn; laws of velocities hold between them."""
    h = interval.length
    before = {
        name: m.y[3:, : m.alive].copy() for name, m in members.items() if group.constraints.laws
    }
    for kick, drift, place in _turns(method):
        time = _at(interval, place)
        if kick:
            group.interact(members, time, memory)
            for member in members.values():
                member.each("kick", member.K, numbers=(time, kick * h))
        if drift:
            group.constraints.apply(members, before, time, drift * h, partners, values)
            memory.push = None
            for member in members.values():
                member.each("drift", member.K, numbers=(time, drift * h))


@cache
def _turns(method: Splitting) -> list[tuple[float, float, float]]:
    """Kick, drift after it and place in the step of every turn."""
    return list(zip(method.kicks, (*method.drifts, 0.0), method.times, strict=True))


def runge_kutta(
    group: Group, members: dict[str, Member], interval: Interval, method: Explicit, memory: Lasting
) -> None:
    """Stages of an explicit table."""
    h, s = interval.length, method.stages
    bases = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
    slopes = {name: np.zeros((s, 6, m.alive), m.y.dtype) for name, m in members.items()}
    for i, row in enumerate((*method.a, method.b)):
        _combine(members, bases, slopes, row, h)
        memory.push = None
        if i == s:
            return
        time = _at(interval, method.c[i])
        group.interact(members, time, memory)
        for name, member in members.items():
            member.each("slope", slopes[name][i], member.K, numbers=(time,))


def implicit_stages(
    group: Group, members: dict[str, Member], interval: Interval, method: Implicit, memory: Lasting
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
            group.interact(members, time, memory)
            for name, member in members.items():
                member.each("slope", slopes[name][place], member.K, numbers=(time,))
            continue
        known = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
        last = math.inf
        for _ in range(implicit.ITERATIONS):
            before = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
            group.interact(members, time, memory)
            memory.push = None
            for name, member in members.items():
                member.each("settled", known[name], member.K, numbers=(time, g))
            change = max(_change(m.y[:, : m.alive], before[name]) for name, m in members.items())
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


def _at(interval: Interval, share: float) -> float:
    """A time within a step; its end is the next one's begin, to the last bit."""
    return interval.end if share == 1.0 else interval.begin + share * interval.length


def _combine(
    members: dict[str, Member],
    bases: dict[str, NDArray[Any]],
    slopes: dict[str, NDArray[Any]],
    weights: Sequence[float],
    h: float,
) -> None:
    """Every member's state becomes base + h sum_j weights_j slopes_j."""
    for name, member in members.items():
        parts, real = even_blocks(member.alive), member.y.dtype.type
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
