"""The time-stepping methods, a stage of all members before the next.

A method changes the members' states `y` and drops what the group remembers of the last push
wherever something moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.staged import combine
from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.group.partners import partners, values
from motes.jit import each, even_blocks
from motes.step import Interval
from motes.tableau import Explicit, Nystrom, Splitting

if TYPE_CHECKING:
    from motes.group.group import Group


def split(
    group: Group, members: dict[str, Member], interval: Interval, method: Splitting,
    memory: Lasting, first: int = 0,
) -> None:  # fmt: skip
    """Kicks and drifts in turn, from the first turn on; laws of velocities hold between them."""
    h = interval.length
    before = {
        name: m.y[3:, : m.alive].copy() for name, m in members.items() if group.constraints.laws
    }
    for kick, drift, place in turns(method)[first:]:
        time = at(interval, place)
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
def turns(method: Splitting) -> list[tuple[float, float, float]]:
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
        combined(members, bases, slopes, row, h)
        memory.push = None
        if i == s:
            return
        time = at(interval, method.c[i])
        group.interact(members, time, memory)
        for name, member in members.items():
            member.each("slope", slopes[name][i], member.K, numbers=(time,))


def nystrom(
    group: Group, members: dict[str, Member], interval: Interval, method: Nystrom, memory: Lasting
) -> None:
    """Stages of a Nystrom table; what acts follows from place and time alone."""
    h, s = interval.length, method.stages
    bases = {name: m.y[:, : m.alive].copy() for name, m in members.items()}
    slopes = {name: np.zeros((s, 6, m.alive), m.y.dtype) for name, m in members.items()}

    def placed(c: float, row: Sequence[float]) -> None:
        for name, m in members.items():
            weights = np.array([h * h * w for w in row], m.y.dtype)
            far = np.tensordot(weights, slopes[name][: len(row), 3:], 1)
            m.y[:3, : m.alive] = bases[name][:3] + m.y.dtype.type(c * h) * bases[name][3:] + far
        memory.push = None

    for i, row in enumerate(method.a):
        placed(method.c[i], row)
        time = at(interval, method.c[i])
        group.interact(members, time, memory)
        for name, member in members.items():
            member.each("slope", slopes[name][i], member.K, numbers=(time,))
    placed(1.0, method.b_position)
    positions = {name: m.y[:3, : m.alive].copy() for name, m in members.items()}
    combined(members, bases, slopes, method.b, h)
    for name, m in members.items():
        m.y[:3, : m.alive] = positions[name]


def at(interval: Interval, share: float) -> float:
    """A time within a step; its end is the next one's begin, to the last bit."""
    return interval.end if share == 1.0 else interval.begin + share * interval.length


def combined(
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
        each(combine, (bases[name], slopes[name], row, real(h), member.y), parts)
