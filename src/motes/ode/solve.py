"""`solve`: first-order systems y' = f(t, y)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motes.integrate import table as find
from motes.ode import explicit, implicit, right_hand_side
from motes.ode.arithmetic import Array
from motes.ode.jacobian import Linearisation, Newton
from motes.ode.march import Control
from motes.ode.run import Machine, March, as_events, asked, checked, ends, fixed
from motes.ode.solution import Event, Solution
from motes.tableau import BackwardDifference, Explicit, Implicit, Rosenbrock, Table

Function = Callable[..., Any]
MOST_STEPS = 100_000_000


def solve(
    f: Function,
    y0: ArrayLike,
    span: tuple[float, float],
    *,
    method: str = "tsit5",
    step: float | None = None,
    rtol: float = 1e-6,
    atol: ArrayLike = 1e-9,
    at: ArrayLike | None = None,
    events: Sequence[Event | Function] = (),
    args: tuple[Any, ...] = (),
    first_step: float | None = None,
    largest_step: float = math.inf,
    max_steps: int = MOST_STEPS,
    dense: bool = True,
    newton: Newton | None = None,
) -> Solution:
    """Solve y' = f(t, y) from y0 over span = (t0, t1), forward or backward.

    With `step`, steps are fixed (the last is shortened to end at t1), at t0 + n step; else the
    method's error estimate keeps the root mean square of error / (atol + rtol |y|) below 1 in each
    step. A Numba function f makes the whole solve machine code; a Python function works as well.

    Args:
        f: f(t, y, *args) -> dy/dt, an array or tuple; y has the shape of y0.
        y0: initial state of any shape.
        span: t0 and t1.
        method: a name from `motes.ode.methods()`.
        step: length of fixed steps, above 0.
        rtol: relative tolerance.
        atol: absolute tolerance, a number or an array like y0.
        at: times (k,) to give states at; without it, every step.
        events: functions g(t, y, *args) whose zeros are found, or `Event`s with direction and end.
        args: further arguments of f.
        first_step: length of the first step, where steps vary.
        largest_step: no step is longer, where steps vary.
        max_steps: the solve gives up after as many.
        dense: whether to keep every step, so that the solution can be called with any time.
        newton: how implicit methods solve their equations.

    Returns:
        Times, states, events, work. Where no step can be found, `success` is False, `message` says
        where and why, and the solution reaches as far as it got.

    Raises:
        SceneError: there is no such method.
        ValueError: a step, tolerance or time that makes no sense, or a method that cannot do this.
    """
    start = np.array(y0, float)
    shape = start.shape
    watched = as_events(events)
    table = find(method)
    tolerances = np.broadcast_to(np.asarray(atol, float), shape).reshape(-1).copy()
    if step is not None:
        control = fixed(span, step, max_steps)
    else:
        control = _adaptive(method, table, span, rtol, tolerances, largest_step, max_steps)
    functions = tuple(event.function for event in watched)
    if isinstance(table, Implicit | Rosenbrock | BackwardDifference):
        near = Linearisation(_flat(f, shape, args), newton or Newton(), tuple(args), start.size)
        solver = implicit.Solver(near, control.rtol, tolerances if step is None else _unit(start))
        watch = right_hand_side.watcher(functions, shape, right_hand_side.PLAIN)
        machine = Machine.build(*implicit.pieces(table, solver), watch, right_hand_side.PLAIN)
    else:
        machine = _machine(f, shape, method, functions)
    march = March(
        machine, control, checked(start, "y0"), tolerances, watched, tuple(args),
        asked(at, span), dense or at is None, first_step or 0.0,
    )  # fmt: skip
    march.run()
    t, y = march.mesh() if at is None else march.answered()
    return Solution(
        **vars(march.work(shape)), t=t, y=y.reshape((-1, *shape)), events=march.crossings(shape),
        dense=march.dense(shape) if dense else None,
    )  # fmt: skip


@lru_cache(maxsize=128)
def _machine(
    f: Function, shape: tuple[int, ...], method: str, events: tuple[Function, ...]
) -> Machine:
    table = find(method)
    wrap = right_hand_side.wrap((f, *events))
    watch = right_hand_side.watcher(events, shape, wrap)
    if isinstance(table, Explicit):
        slope = right_hand_side.slope(f, shape)
        pieces = explicit.pieces(table, slope, wrap)
        return Machine.build(pieces, explicit.space(table), watch, wrap)
    raise ValueError(f"\"{method}\" is for x'' = a(t, x): use solve_newton")


def _flat(f: Function, shape: tuple[int, ...], args: tuple[Any, ...]) -> Function:
    """f of a flat state, for linear algebra."""

    def flat(t: float, y: Array) -> Array:
        return np.asarray(f(t, y.reshape(shape), *args), float).reshape(-1)

    return flat


def _unit(start: Array) -> Array:
    """Scales for Newton's method where no tolerance is given: the size of the initial state."""
    return np.full(start.size, max(float(np.abs(start).max(initial=0.0)), 1e-300))


def _adaptive(
    method: str,
    table: Table,
    span: tuple[float, float],
    rtol: float,
    atol: Array,
    largest: float,
    limit: int,
) -> Control:
    if getattr(table, "b_low", None) is None:
        raise ValueError(f'"{method}" has no error estimate: give it a step')
    if not (0 <= rtol < 1 and (atol >= 0).all() and (rtol > 0 or (atol > 0).all())):
        raise ValueError("rtol must lie in 0 ... 1 and atol be at least 0, one of them above 0")
    order = table.order if isinstance(table, Explicit) else table.low_order + 1  # type: ignore[union-attr]
    # Below some roundings of y, no step could ever be accepted.
    t0, t1 = ends(span)
    return Control(False, t0, t1, 0.0, 0, max(rtol, 1e-15), float(order), largest, limit)
