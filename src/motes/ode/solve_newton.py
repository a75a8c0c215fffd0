"""`solve_newton`: second-order systems x'' = a(t, x, v)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motes.integrate import method as find
from motes.ode import newton, right_hand_side
from motes.ode.march import Room
from motes.ode.right_hand_side import FirstOrder, OfBoth, refuse
from motes.ode.run import (
    Machine,
    March,
    as_events,
    asked,
    checked,
    counted,
    ends,
    fixed,
    further,
    numbers,
)
from motes.ode.solution import Event, NewtonSolution
from motes.ode.solve import MOST_STEPS, solve
from motes.tableau import Nystrom, Splitting

Function = Callable[..., Any]


def solve_newton(
    acceleration: Function,
    x0: ArrayLike,
    v0: ArrayLike,
    span: tuple[float, float],
    *,
    method: str = "leapfrog",
    step: float | None = None,
    drag: ArrayLike | None = None,
    conservative: bool = False,
    at: ArrayLike | None = None,
    events: Sequence[Event | Function] = (),
    args: tuple[Any, ...] = (),
    max_steps: int = MOST_STEPS,
    dense: bool = True,
    **options: Any,
) -> NewtonSolution:
    """Solve x'' = a(t, x, x') from (x0, v0) over span = (t0, t1), forward or backward.

    Splittings (leapfrog, yoshida4 ...) and Nystrom methods take fixed steps; every method of
    `solve` works as well, on (x, v) together, and takes the further options of `solve`.

    Args:
        acceleration: a(t, x, v, *args), an array or tuple like x.
        x0: initial position of any shape.
        v0: initial velocity, of the same shape.
        span: t0 and t1.
        method: a name from `motes.ode.methods()`.
        step: length of fixed steps, above 0.
        drag: rate k >= 0 [1/time], a number or an array like x: adds -k v. Splittings without
            backward steps integrate it exactly, so that no step is too long for it.
        conservative: promises that the acceleration does not depend on v. Splittings that begin
            and end with a kick, such as leapfrog, then need one evaluation less in each step.
        at: times (k,) to give states at; without it, every step.
        events: functions g(t, x, v, *args) whose zeros are found, or `Event`s.
        args: further arguments of the acceleration.
        max_steps: the solve gives up after as many.
        dense: whether to keep every step, so that the solution can be called with any time.
        options: what else `solve` takes, for its methods.

    Returns:
        Times, positions, velocities, events, work.

    Raises:
        SceneError: there is no such method.
        ValueError: a step, rate or time that makes no sense, or a method that cannot do this.
    """
    table = find(method)
    x, v = numbers(x0, "x0"), numbers(v0, "v0")
    if x.shape != v.shape:
        raise ValueError(f"x0 has shape {x.shape}, but v0 has {v.shape}")
    shape, both = (2, *x.shape), np.stack([x, v])
    args, max_steps = further(args), counted(max_steps)
    watched = tuple(dataclasses.replace(e, function=OfBoth(e.function)) for e in as_events(events))
    if not isinstance(table, Splitting | Nystrom):
        if drag is not None:
            raise ValueError(f'"{method}" takes drag as part of the acceleration')
        f = FirstOrder(acceleration, x.shape)
        r = solve(
            f, both, span, method=method, step=step, at=at, events=watched, args=args,
            max_steps=max_steps, dense=dense, **options,
        )  # fmt: skip
        y = r.y
        given = {name: getattr(r, name) for name in _SHARED}
        return NewtonSolution(**given, x=y[:, 0], v=y[:, 1])
    if options:
        raise TypeError(f'"{method}" does not take {", ".join(options)}')
    if step is None:
        raise ValueError(f'"{method}" has no error estimate: give it a step')
    rates = () if drag is None else (_rates(method, table, drag, x.shape),)
    machine = _machine(
        acceleration, x.shape, method, tuple(e.function for e in watched), conservative, bool(rates)
    )
    march = March(
        machine, fixed(span, step, max_steps), checked(both, "x0 and v0"), np.ones(both.size),
        watched, (*rates, *args), asked(at, span), dense or at is None, 0.0,
    )  # fmt: skip
    march.run(lambda: refuse(acceleration, x.shape, ends(span)[0], x[()], v[()], *args))
    t, y = march.mesh() if at is None else march.answered()
    y = y.reshape((-1, *shape))
    return NewtonSolution(
        **vars(march.work(shape, "(x, v)")), t=t, x=y[:, 0], v=y[:, 1],
        events=march.crossings(shape), dense=march.dense(shape) if dense else None,
    )  # fmt: skip


_SHARED = (
    "evaluations", "steps", "rejected", "success", "message", "t", "events", "dense",
)  # fmt: skip


def _rates(
    method: str, table: Splitting | Nystrom, drag: ArrayLike, shape: tuple[int, ...]
) -> np.ndarray[Any, np.dtype[np.float64]]:
    given = numbers(drag, "drag")
    if given.shape not in ((), shape):
        raise ValueError(
            f"drag must be a number or have the shape of x0, {shape}, not {given.shape}"
        )
    rates = np.broadcast_to(given, shape).reshape(-1).copy()
    if not (np.isfinite(rates) & (rates >= 0)).all():
        raise ValueError("drag must be finite and at least 0")
    if isinstance(table, Nystrom) or min(*table.kicks, *table.drifts) < 0 or table.order > 2:
        raise ValueError(f'"{method}" cannot take drag exactly; leapfrog and position_verlet can')
    return rates


@lru_cache(maxsize=128)
def _machine(
    acceleration: Function,
    shape: tuple[int, ...],
    method: str,
    events: tuple[Function, ...],
    conservative: bool,
    drag: bool,
) -> Machine:
    table = find(method)
    wrap = right_hand_side.wrap((acceleration, *events))
    watch = right_hand_side.watcher(events, (2, *shape), wrap)
    a = right_hand_side.acceleration(acceleration, shape, int(drag))
    if isinstance(table, Nystrom):
        pieces, room = newton.nystrom(table, a, wrap), Room(table.stages, 0)
    else:
        assert isinstance(table, Splitting)
        pieces = newton.splitting(table, a, wrap, conservative=conservative, drag=drag)
        room = newton.SPLITTING
    return Machine.build(pieces, room, watch, wrap)
