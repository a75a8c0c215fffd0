"""`solve_many`: the same system from many initial states, each with its own steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numba import TypingError
from numpy.typing import ArrayLike, NDArray

from motes.integrate import method as find
from motes.jit import blocks, share
from motes.ode import lanes
from motes.ode.arithmetic import Array, Kernel
from motes.ode.right_hand_side import compiled, refuse
from motes.ode.run import asked, counted, ends, fixed, further, numbers
from motes.ode.solve import MOST_STEPS, solve
from motes.tableau import Explicit

Function = Callable[..., Any]

BLOCK = 1024
"""Systems that one call of a kernel takes."""

WIDEST = 24
"""Components that a system may have to be solved in lanes; beyond, its state leaves the cache."""


@dataclass(frozen=True)
class ManySolutions:
    """Solutions of m systems."""

    t: Array
    """Times, (k,): those of `at`, or the end of the span alone."""

    y: Array
    """States, (m, k, ...)."""

    evaluations: NDArray[np.int64]
    """Calls of the right-hand side, (m,)."""

    steps: NDArray[np.int64]
    """Steps taken, (m,)."""

    rejected: NDArray[np.int64]
    """Steps taken again, (m,)."""

    success: NDArray[np.bool_]
    """Whether each system reached the end, with finite numbers, (m,)."""


def solve_many(
    f: Function,
    y0s: ArrayLike,
    span: tuple[float, float],
    *,
    args: tuple[ArrayLike, ...] = (),
    method: str = "tsit5",
    step: float | None = None,
    rtol: float = 1e-6,
    atol: float = 1e-9,
    at: ArrayLike | None = None,
    max_steps: int = MOST_STEPS,
) -> ManySolutions:
    """Solve y' = f(t, y, *args) from m initial states, on all processors.

    A Numba function of few components that reads its state by number, y[0], y[1] ..., and returns
    a tuple is solved sixteen systems at a time, with an explicit method; others one by one. The
    result depends on neither the number of threads nor the other systems.

    Args:
        f: f(t, y, *args) -> dy/dt.
        y0s: initial states, (m, ...).
        span: t0 and t1.
        args: further arguments of f, each a number or one number for each system, (m,).
        method: a name from `motes.ode.methods()`.
        step: length of fixed steps; without it, every system chooses its own.
        rtol: relative tolerance.
        atol: absolute tolerance.
        at: times (k,) to give states at; each is the end of a step. Without it, only t1.
        max_steps: a system gives up after as many.

    Returns:
        States (m, k, ...), and what they cost.

    Raises:
        SceneError: there is no such method.
        ValueError: shapes, times or tolerances that make no sense.
    """
    starts = numbers(y0s, "y0s")
    if starts.ndim == 0:
        raise ValueError("y0s must be (m, ...): one initial state for each system")
    max_steps = counted(max_steps)
    given = [numbers(arg, "an argument") for arg in further(args)]
    for arg in given:
        if arg.shape not in ((), (len(starts),)):
            raise ValueError(f"an argument is a number or ({len(starts)},), not {arg.shape}")
    if not np.isfinite(starts).all():
        raise ValueError("y0s must be finite")
    times = asked([span[1]] if at is None else at, span)
    table = find(method)
    if (
        isinstance(table, Explicit)
        and compiled(f)
        and starts.ndim == 2
        and starts.shape[1] <= WIDEST
    ):
        if step is None and table.b_low is None:
            raise ValueError(f'"{method}" has no error estimate: give it a step')
        if not (0 <= rtol < 1 and atol >= 0 and rtol + atol > 0):
            raise ValueError("rtol must lie in 0 ... 1 and atol be at least 0, one of them above 0")
        if step is not None:
            fixed(span, step, max_steps)
        kernel = _kernel(f, starts.shape[1], len(given), method)
        if kernel is not None:
            found = _in_lanes(
                kernel, starts, ends(span)[0], times, given, step, rtol, atol, max_steps
            )
            for lost in np.flatnonzero(~found.success & (found.steps == 0))[:1]:
                own = [float(arg[lost] if arg.ndim else arg) for arg in given]
                refuse(f, starts.shape[1:], ends(span)[0], tuple(starts[lost]), *own)
            return found
    options = {"method": method, "step": step, "rtol": rtol, "atol": atol, "max_steps": max_steps}
    return _one_by_one(f, starts, span, times, given, options)


@lru_cache(maxsize=64)
def _kernel(f: Function, size: int, arguments: int, method: str) -> Kernel | None:
    """The kernel for f, or None where f needs its state as an array."""
    table = find(method)
    assert isinstance(table, Explicit)
    kernel = lanes.march(f, size, arguments, table)
    try:
        _call(kernel, 0.0, 1.0, lanes.Batch(*_empty(size, 0)), np.zeros((arguments, 1)), 0.0,
              1e-6, 1e-6, 1, 0, 0)  # fmt: skip
    except TypingError:
        return None
    return kernel


def _empty(size: int, count: int) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    return (
        np.zeros((size, count)),
        np.zeros(count),
        np.ones(count),
        np.zeros((4, count), np.int64),
    )


def _call(
    kernel: Kernel, t0: float, t1: float, batch: lanes.Batch, parameters: Array, step: float,
    rtol: float, atol: float, limit: int, low: int, high: int,
) -> None:  # fmt: skip
    tolerances = np.full(len(batch.y), atol)
    kernel(
        t0,
        t1,
        batch,
        parameters,
        step > 0,
        rtol,
        tolerances,
        float(limit),
        low,
        high,
        lanes.LANES,
    )


def _in_lanes(
    kernel: Kernel, starts: Array, t0: float, times: Array, args: list[Array],
    step: float | None, rtol: float, atol: float, limit: int,
) -> ManySolutions:  # fmt: skip
    count, size = starts.shape
    batch = lanes.Batch(*_empty(size, count))
    batch.y[:] = starts.T
    parameters = np.zeros((len(args), count if any(arg.ndim for arg in args) else 1))
    for row, arg in zip(parameters, args, strict=True):
        row[:] = arg
    y = np.empty((count, times.size, size))
    parts = blocks(count, BLOCK)
    for place, t1 in enumerate(times):
        if step is not None:
            batch.step[:] = step
        if t1 != t0:

            def run(number: int, t0: float = t0, t1: float = t1) -> None:
                bounds = parts[number]
                _call(kernel, t0, t1, batch, parameters, step or 0.0, rtol, atol, limit, *bounds)

            share(run, len(parts))
        y[:, place] = batch.y.T
        t0 = t1
    evaluations, steps, rejected, failed = batch.work
    return ManySolutions(times, y, evaluations, steps, rejected, failed == 0)


def _one_by_one(
    f: Function,
    starts: Array,
    span: tuple[float, float],
    times: Array,
    args: list[Array],
    options: dict[str, Any],
) -> ManySolutions:
    count, shape = len(starts), starts.shape[1:]
    y = np.full((count, times.size, *shape), np.nan)
    work = np.zeros((3, count), np.int64)
    success = np.zeros(count, bool)

    def run(number: int) -> None:
        own = tuple(float(arg[number] if arg.ndim else arg) for arg in args)
        r = solve(f, starts[number], span, at=times, args=own, dense=False, **options)
        y[number, : len(r.y)] = r.y
        work[:, number] = r.evaluations, r.steps, r.rejected
        success[number] = r.success and np.isfinite(r.y).all()

    if compiled(f) and count:
        run(0)  # Compiles, before several threads want the same code.
        share(lambda number: run(number + 1), count - 1)
    else:
        for number in range(count):
            run(number)
    return ManySolutions(times, y, work[0], work[1], work[2], success)
