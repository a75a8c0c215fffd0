"""The user's functions, compiled or not, in the one form that the solvers call."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any, NamedTuple

import numpy as np
from numba.core.dispatcher import Dispatcher

from motes import jit as machine_code
from motes.jit import EXACT, jit
from motes.ode.arithmetic import Kernel, copy

Function = Callable[..., Any]


@dataclass(frozen=True)
class FirstOrder:
    """y' = (v, a(t, x, v)) for y = (x, v)."""

    acceleration: Function
    shape: tuple[int, ...]
    """That of x."""

    def __call__(self, t: Any, y: Any, *args: Any) -> Any:
        """y' as one array."""
        value = np.asarray(self.acceleration(t, *y, *args))
        if value.size != math.prod(self.shape):
            raise misfit(value, self.shape)
        return np.stack([y[1], value.reshape(self.shape)])


@dataclass(frozen=True)
class OfBoth:
    """An event g(t, x, v) of a state y = (x, v)."""

    function: Function

    def __call__(self, t: Any, y: Any, *args: Any) -> Any:
        """Its value for a state."""
        return self.function(t, *y, *args)


def compiled(*functions: Any) -> bool:
    """Whether all of these are Numba functions, so that a whole solve can be machine code."""
    return all(
        isinstance(_users(function), Dispatcher | machine_code.Kernel) for function in functions
    )


def _users(function: Any) -> Any:
    """The function that the user wrote."""
    if isinstance(function, FirstOrder):
        return function.acceleration
    return function.function if isinstance(function, OfBoth) else function


class Wrap(NamedTuple):
    """What is done to the parts of a solver: compiled around compiled functions, or left alone."""

    loop: Callable[[Function], Kernel]
    """For what Python calls."""
    part: Callable[[Function], Kernel]
    """For what only loops call."""


COMPILED = Wrap(jit, lambda function: jit(function, inline=True))
PLAIN = Wrap(lambda function: function, lambda function: function)


def wrap(functions: Sequence[Any]) -> Wrap:
    """Whether these functions can be parts of machine code."""
    return COMPILED if compiled(*functions) else PLAIN


def slope(f: Function, shape: tuple[int, ...]) -> Kernel:
    """slope(t, y, w, row, args): a row of w becomes f(t, y in its shape, *args)."""
    size = math.prod(shape)
    if not compiled(f):

        def line(t, y, w, row, args):  # type: ignore[no-untyped-def]
            value = f(t, y, *args)
            if not hasattr(value, "__len__") or len(value) != size:
                raise misfit(value, shape)
            w[row * size : (row + 1) * size] = value

        def call(t, y, w, row, args):  # type: ignore[no-untyped-def]
            value = np.asarray(f(t, y.reshape(shape), *args))
            if value.size != size:
                raise misfit(value, shape)
            w[row * size : (row + 1) * size] = value.reshape(-1)

        return line if len(shape) == 1 else call
    if isinstance(f, FirstOrder):
        return _slope_of_both(f, size)
    f = _fused(f)
    if not shape:

        def number(t, y, w, row, args):  # type: ignore[no-untyped-def]
            w[row] = f(t, y[0], *args)

        return jit(number)
    if len(shape) == 1:

        def vector(t, y, w, row, args):  # type: ignore[no-untyped-def]
            value = f(t, y, *args)
            if len(value) == size:
                for i in range(size):
                    w[row * size + i] = value[i]
            else:  # Of another shape than the state: no solution, and nothing read beyond its end.
                for i in range(size):
                    w[row * size + i] = np.nan

        return jit(vector)

    def block(t, y, w, row, args):  # type: ignore[no-untyped-def]
        value = f(t, y.reshape(shape), *args).ravel()
        if value.size == size:
            w[row * size : (row + 1) * size] = value
        else:
            w[row * size : (row + 1) * size] = np.nan

    return jit(block)


def misfit(value: Any, shape: tuple[int, ...]) -> ValueError:
    """What is said of a function that gives another shape than its state's."""
    count = np.size(value)
    return ValueError(
        f"the function gave {count} number{'s' * (count != 1)}, shape {np.shape(value)}, for a "
        f"state of {math.prod(shape)}, shape {shape}"
    )


def refuse(f: Function, shape: tuple[int, ...], t: float, *given: Any) -> None:
    """Raise what is wrong with a compiled function, where a solve could not even begin.

    It is called once as plain Python, at a time with what is given; solves that begin pay nothing.

    Raises:
        ValueError: it gives nothing, another shape than its state's, or does not take so many
            arguments.
    """
    if isinstance(f, FirstOrder):
        shape, given = f.shape, (*given[0], *given[1:])
        f = f.acceleration
    plain = getattr(f, "py_func", f)
    try:
        signature(plain).bind(t, *given)
    except TypeError as fault:
        raise ValueError(
            f"the function cannot be called with t, a state and args: {fault}"
        ) from None
    try:
        value = plain(t, *given)
    except Exception:
        return  # What machine code makes of it, such as an infinite number, has been said.
    if value is None:
        raise ValueError("the function gave nothing; it must return the slope of its state")
    if np.size(value) != math.prod(shape) or (np.shape(value) and not shape):
        raise misfit(value, shape)


def _slope_of_both(f: FirstOrder, size: int) -> Kernel:
    n, accelerate = size // 2, acceleration(f.acceleration, f.shape, 0)

    def both(t, y, w, row, args):  # type: ignore[no-untyped-def]
        first = row * size
        copy(y[n:], w[first : first + n])
        accelerate(t, y[:n], y[n:], w[first + n : first + size], args)

    return jit(both)


def acceleration(f: Function, shape: tuple[int, ...], skip: int) -> Kernel:
    """acceleration(t, x, v, out, args): out = f(t, x, v, *args[skip:]) in the shape of x."""
    if not compiled(f):

        def call(t, x, v, out, args):  # type: ignore[no-untyped-def]
            value = np.asarray(f(t, x.reshape(shape), v.reshape(shape), *args[skip:]))
            if value.size != x.size:
                raise misfit(value, shape)
            out[:] = value.reshape(-1)

        return call
    f = _fused(f)
    if not shape:

        def number(t, x, v, out, args):  # type: ignore[no-untyped-def]
            out[0] = f(t, x[0], v[0], *args[skip:])

        return jit(number)
    if len(shape) == 1:
        size = shape[0]

        def vector(t, x, v, out, args):  # type: ignore[no-untyped-def]
            value = f(t, x, v, *args[skip:])
            if len(value) == size:
                for i in range(size):
                    out[i] = value[i]
            else:
                for i in range(size):
                    out[i] = np.nan

        return jit(vector)

    def block(t, x, v, out, args):  # type: ignore[no-untyped-def]
        value = f(t, x.reshape(shape), v.reshape(shape), *args[skip:]).ravel()
        if value.size == out.size:
            out[:] = value
        else:
            out[:] = np.nan

    return jit(block)


def _fused(f: Any) -> Kernel:
    """The same function with fused multiply-add, which saves a fifth of its time.

    A Numba function that asks for more, such as parallel loops, checks of bounds or fast
    arithmetic, stays.
    """
    asked = {name for name, value in getattr(f, "targetoptions", {}).items() if value}
    return jit(f.py_func, flags=EXACT, inline=True) if asked <= _PLAIN_OPTIONS else f


_PLAIN_OPTIONS = {"nopython", "error_model", "nogil", "cache"}


def nothing(wrap: Wrap) -> Kernel:
    """watch(t, y, g, args) of no events."""

    @wrap.part
    def watch(t, y, g, args):  # type: ignore[no-untyped-def]
        pass

    return watch


def watcher(events: Sequence[Any], shape: tuple[int, ...], wrap: Wrap) -> Kernel | None:
    """watch(t, y, g, args): the value of every event into g; None where there is none."""
    if not events:
        return None
    if wrap is PLAIN:

        def watch(t, y, g, args):  # type: ignore[no-untyped-def]
            for i, event in enumerate(events):
                g[i] = event(t, y.reshape(shape), *args)

        return watch

    chain = nothing(wrap)
    for place, event in enumerate(events):
        chain = _link(chain, event, place, shape)
    return chain


def _link(before: Kernel, event: Any, place: int, shape: tuple[int, ...]) -> Kernel:
    """One more event after those before it: Numba cannot loop over functions of several types."""
    if isinstance(event, OfBoth):
        function = event.function

        def pair(t, y, g, args):  # type: ignore[no-untyped-def]
            before(t, y, g, args)
            both = y.reshape(shape)
            g[place] = function(t, both[0], both[1], *args)

        return jit(pair)
    if not shape:

        def number(t, y, g, args):  # type: ignore[no-untyped-def]
            before(t, y, g, args)
            g[place] = event(t, y[0], *args)

        return jit(number)

    def link(t, y, g, args):  # type: ignore[no-untyped-def]
        before(t, y, g, args)
        g[place] = event(t, y.reshape(shape), *args)

    return jit(link)
