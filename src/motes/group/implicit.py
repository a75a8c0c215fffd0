"""Implicit methods for a group: which stages there are, what is known of each, how they add up."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.compile import implicit
from motes.group.lasting import Lasting
from motes.group.members import Member
from motes.group.methods import at, combined
from motes.group.stages import Stages
from motes.step import Interval
from motes.tableau import BackwardDifference, Implicit

if TYPE_CHECKING:
    from motes.group.group import Group

Members = dict[str, Member]
Blocks = dict[str, NDArray[Any]]


def one_by_one(
    group: Group, members: Members, interval: Interval, method: Implicit, memory: Lasting
) -> None:
    """Stages that stand for themselves.

    In a group whose method is split, the forces that are declared stiff are taken implicitly, row
    by row, all others and the pushes between particles explicitly, once a stage.
    """
    h, places = interval.length, implicit.stages(method)
    split = next(iter(members.values())).stepper.system.motion.split
    bases, s = _states(members), len(places)
    slopes = _room(members, 2 * s if split else s)
    for place, i in enumerate(places):
        row = [method.a[i][j] for j in places[:place]]
        if split:
            row += [0.0] * (s - place) + [method.a_explicit[i][j] for j in places[:place]]
        combined(members, bases, slopes, row, h)
        memory.push = None
        time, g = at(interval, method.c[i]), method.a[i][i] * h
        known = _states(members)
        if g and split:
            _unpushed(members)
            for name, m in members.items():
                m.each("settled", known[name], m.K, numbers=(time, g))
        elif g:
            _settle(group, members, memory, interval, time, g, known)
        else:
            _unpushed(members) if split else group.interact(members, time, memory)
            for name, m in members.items():
                m.each("slope", slopes[name][place], m.K, numbers=(time,))
        if g:
            for name, m in members.items():
                slopes[name][place] = (m.y[:, : m.alive] - known[name]) / m.y.dtype.type(g)
        if split:
            group.interact(members, time, memory)
            for name, m in members.items():
                m.each("eased", slopes[name][s + place], m.K, numbers=(time,))
    weights = [method.b[i] for i in places]
    combined(members, bases, slopes, weights * 2 if split else weights, h)
    memory.push = None


def _settle(
    group: Group,
    members: Members,
    memory: Lasting,
    interval: Interval,
    time: float,
    g: float,
    known: Blocks,
    *more: Blocks,
) -> None:
    """Every state becomes known + g f(state), with g the stage's own share of the step."""

    def solve(_: int) -> None:
        for name, m in members.items():
            m.push = stages.pushes[name][0]
            m.each("settled", known[name], *(block[name] for block in more), m.K, numbers=(time, g))

    stages = Stages(group, members, memory, [time], lambda: None, solve, g * g)
    stages.settle(interval)


def together(
    group: Group, members: Members, interval: Interval, method: Implicit, memory: Lasting
) -> None:
    """Stages that belong together."""
    h, places = interval.length, implicit.stages(method)
    bases, slopes = _states(members), _room(members, len(places))
    rows = [[method.a[i][j] for j in places] for i in places]

    def begin() -> None:
        for name, m in members.items():
            m.push = stages.pushes[name].reshape(-1, m.alive)
            flat = slopes[name].reshape(-1, m.alive)
            m.each("settled", bases[name], flat, m.K, numbers=(interval.begin, h))

    def solve(k: int) -> None:
        combined(members, bases, slopes, rows[k], h)

    times = [at(interval, method.c[i]) for i in places]
    stages = Stages(group, members, memory, times, begin, solve, h * h)
    stages.settle(interval)
    combined(members, bases, slopes, [method.b[i] for i in places], h)
    memory.push = None


def backward_difference(
    group: Group, members: Members, interval: Interval, _: BackwardDifference, memory: Lasting
) -> None:
    """One stage, at the step's end, from the state at its begin and the change before."""
    known, h = _states(members), interval.length
    past = {name: m.rows.past for name, m in members.items()}
    memory.push = None
    _settle(group, members, memory, interval, interval.end, h, known, past)
    for name, m in members.items():
        m.rows.past[:6, : m.alive] = m.y[:, : m.alive] - known[name]
        m.rows.past[6, : m.alive] = 1 / h


def _states(members: Members) -> Blocks:
    return {name: m.y[:, : m.alive].copy() for name, m in members.items()}


def _room(members: Members, count: int) -> Blocks:
    return {name: np.zeros((count, 6, m.alive), m.y.dtype) for name, m in members.items()}


def _unpushed(members: Members) -> None:
    for m in members.values():
        m.push = np.zeros((3, m.alive), m.y.dtype)
