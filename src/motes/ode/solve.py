"""`solve`: first-order systems y' = f(t, y)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from motes.integrate import method as find
from motes.integrate import methods
from motes.ode import additive, explicit, implicit, right_hand_side
from motes.ode.arithmetic import Array
from motes.ode.implicit_frame import EXACTLY
from motes.ode.jacobian import Newton, NewtonKey
from motes.ode.march import Control
from motes.ode.right_hand_side import refuse
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
    positive,
)
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
    stiff: Function | None = None,
) -> Solution:
    """Solve y' = f(t, y), or f + stiff, from y0 over span = (t0, t1), forward or backward.

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
        stiff: a part g(t, y, *args) of y' = f + g, such as damping, which kencarp3 and kencarp4
            take implicitly while they take f explicitly. Newton's method then sees g alone.

    Returns:
        Times, states, events, work. Where no step can be found, `success` is False, `message` says
        where and why, and the solution reaches as far as it got.

    Raises:
        SceneError: there is no such method.
        ValueError: a step, tolerance or time that makes no sense, or a method that cannot do this.
    """
    start = numbers(y0, "y0")
    checked(start, "y0")
    shape = start.shape
    watched, args, max_steps = as_events(events), further(args), counted(max_steps)
    table = find(method)
    tolerances = _tolerances(atol, shape)
    if step is not None:
        control = fixed(span, step, max_steps)
    else:
        control = _adaptive(method, table, span, rtol, atol, largest_step, max_steps)
    if first_step is not None:
        positive(first_step, "first_step")
    if newton is not None and not isinstance(newton, Newton):
        raise ValueError("newton must be an ode.Newton, which says how equations are solved")
    functions = tuple(event.function for event in watched)
    if stiff is not None and not getattr(table, "a_explicit", ()):
        pairs = [name for name, t in methods().items() if getattr(t, "a_explicit", ())]
        raise ValueError(f'"{method}" takes y\' whole; {" and ".join(pairs)} take a stiff part')
    inner: tuple[Array | float, float] | None = None
    if isinstance(table, Implicit | Rosenbrock | BackwardDifference):
        key = (newton or Newton()).key(start.size)
        machine = _implicit(f, shape, method, functions, key, stiff)
        inner = (tolerances * 0.01, control.rtol * 0.01)
        if step is not None:
            inner = _size(start) * EXACTLY, EXACTLY
    else:
        machine = _explicit(f, shape, method, functions)
    march = March(
        machine, control, checked(start, "y0"), tolerances, watched, args,
        asked(at, span), dense or at is None, first_step or 0.0, inner,
    )  # fmt: skip
    march.run(lambda: refuse(f, shape, ends(span)[0], start[()], *args))
    t, y = march.mesh() if at is None else march.answered()
    return Solution(
        **vars(march.work(shape)), t=t, y=y.reshape((-1, *shape)), events=march.crossings(shape),
        dense=march.dense(shape) if dense else None,
    )  # fmt: skip


@lru_cache(maxsize=128)
def _explicit(
    f: Function, shape: tuple[int, ...], method: str, events: tuple[Function, ...]
) -> Machine:
    table = find(method)
    wrap = right_hand_side.wrap((f, *events))
    watch = right_hand_side.watcher(events, shape, wrap)
    if isinstance(table, Explicit):
        slope = right_hand_side.slope(f, shape)
        size = math.prod(shape) if wrap is right_hand_side.COMPILED else None
        pieces = explicit.pieces(table, slope, wrap, size)
        return Machine.build(pieces, explicit.room(table), watch, wrap)
    raise ValueError(f"\"{method}\" is for x'' = a(t, x): use solve_newton")


@lru_cache(maxsize=128)
def _implicit(
    f: Function,
    shape: tuple[int, ...],
    method: str,
    events: tuple[Function, ...],
    key: NewtonKey,
    stiff: Function | None,
) -> Machine:
    table = find(method)
    assert isinstance(table, Implicit | Rosenbrock | BackwardDifference)
    size, newton = math.prod(shape), key.newton(math.prod(shape))
    given = () if newton.jacobian is None else (newton.jacobian,)
    parts = (f,) if stiff is None else (f, stiff)
    wrap = right_hand_side.wrap((*parts, *events, *given))
    watch = right_hand_side.watcher(events, shape, wrap)
    slopes = [right_hand_side.slope(part, shape) for part in parts]
    if stiff is not None:
        assert isinstance(table, Implicit)
        pair = additive.additive(table, slopes[0], slopes[1], newton, size, wrap)
        return Machine.build(*pair, watch, wrap)
    slope = slopes[0]
    return Machine.build(*implicit.pieces(table, slope, newton, size, wrap), watch, wrap)


def _tolerances(atol: ArrayLike, shape: tuple[int, ...]) -> Array:
    """An absolute tolerance for each component, in one row."""
    given = numbers(atol, "atol")
    if given.shape not in ((), shape):
        raise ValueError(
            f"atol must be a number or have the shape of y0, {shape}, not {given.shape}"
        )
    return np.broadcast_to(given, shape).reshape(-1).copy()


def _size(start: Array) -> float:
    """Scale for Newton's method where no tolerance is given: the size of the initial state."""
    return max(float(np.abs(start).max(initial=0.0)), 1e-300)


def _adaptive(
    method: str,
    table: Table,
    span: tuple[float, float],
    rtol: float,
    atol: ArrayLike,
    largest: float,
    limit: int,
) -> Control:
    past = isinstance(table, BackwardDifference)
    if getattr(table, "b_low", None) is None and not past:
        raise ValueError(f'"{method}" has no error estimate: give it a step')
    if not isinstance(rtol, SupportsFloat):
        raise ValueError(f"rtol must be one number, not {rtol!r}")
    if not largest > 0:
        raise ValueError(f"largest_step must be above 0, not {largest}")
    least = atol if isinstance(atol, float | int) else float(np.min(atol, initial=math.inf))
    if not (0 <= rtol < 1 and least >= 0 and (rtol > 0 or least > 0)):
        raise ValueError("rtol must lie in 0 ... 1 and atol be at least 0, one of them above 0")
    order = table.order
    if isinstance(table, Implicit | Rosenbrock):
        order = min(order, table.low_order)
    if not isinstance(table, Explicit):
        order += 1
    # Below some roundings of y, no step could ever be accepted. A formula with a past is stable
    # only while steps grow slowly: the second one, up to 1 + sqrt(2).
    t0, t1 = ends(span)
    rtol, most = max(rtol, 1e-15), 2.0 if past else 10.0
    return Control(False, t0, t1, 0.0, 0, rtol, float(order), largest, limit, most)
