"""Pictures of a problem and what methods make of it, clear enough for a slide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.errors import MissingExtra
from motes.integrate import method as find
from motes.jit import jit
from motes.ode.arithmetic import Array
from motes.ode.right_hand_side import FirstOrder
from motes.ode.solution import Work
from motes.ode.solve import solve
from motes.ode.solve_newton import solve_newton
from motes.ode.stability import growth
from motes.problem import Problem, about, problem
from motes.tableau import Nystrom, Splitting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Okabe and Ito's colours: told apart with every kind of colour vision."""

MARKS = "osD^vP*"
HALVINGS = 5
SHAPE = 0.9
"""Width of the pane of paths over its height."""

FAR = 3.0
"""Sizes of the exact path from which on a path is gone for good."""

MOST = 1_000_000
"""Steps of the longest solve that is drawn."""


@dataclass(frozen=True)
class Run:
    """What one method makes of a problem at one step."""

    t: Array
    y: Array
    work: Work

    @property
    def whole(self) -> bool:
        """Whether it reached the end with finite numbers."""
        return self.work.success and bool(np.isfinite(self.y).all())


_machine_code = lru_cache(maxsize=64)(jit)
"""Problems' functions as kernels, one of each."""


def run(of: Problem, method: str, step: float | None, **options: Any) -> Run:
    """Solve a problem with fixed steps, or with `step` None within tolerances."""
    if isinstance(find(method), Splitting | Nystrom):
        if of.acceleration is None:
            raise ValueError(f"\"{method}\" is for x'' = a(t, x), which this problem is not")
        x, v = np.split(np.array(of.start), 2)
        a = _machine_code(of.acceleration)
        n = solve_newton(a, x, v, of.span, method=method, step=step, **options)
        return Run(n.t, np.concatenate([n.x, n.v], axis=1), n)
    f: Any = of.slope
    if of.acceleration is None:
        f = _machine_code(f)
    else:
        f = FirstOrder(_machine_code(of.acceleration), (of.size,))
    r = solve(f, of.start, of.span, method=method, step=step, **options)
    return Run(r.t, r.y, r)


def draw(
    name: str, *, methods: Sequence[str] | None = None, steps: Sequence[float] | None = None
) -> Figure:
    """Five views of a problem as one Matplotlib figure.

    The paths of all methods at the first step; the error at the end against the step, with the
    measured slope; energy, or a component, over time; the first method's region of stability with
    h lambda of the problem in it; the error against evaluations.

    Args:
        name: a problem of `motes.problem`.
        methods: names of methods; without it, those that suit the problem.
        steps: the first is the one whose path is drawn, all are lengths to measure errors at;
            with one or none, it is halved.

    Raises:
        MissingExtra: Matplotlib is not installed.
        SceneError: there is no such problem or method.
        ValueError: a method or step that makes no sense.
    """
    try:
        from matplotlib import rc_context
    except ImportError:
        raise MissingExtra("pictures need Matplotlib: pip install 'motes[plot]'") from None
    of = problem(name)
    chosen = tuple(dict.fromkeys(methods or of.methods))
    lengths = list(dict.fromkeys(steps or (of.step,)))
    if len(lengths) == 1:
        lengths = [lengths[0] / 2**k for k in range(HALVINGS)]
    span = abs(of.span[1] - of.span[0])
    if span / min(lengths) > MOST:
        raise ValueError(
            f"a step of {min(lengths):g} is too short for a picture: {span / min(lengths):.2g} of "
            f"them fill the span, {MOST:g} at most are drawn"
        )
    with rc_context({"font.size": 12, "axes.titlesize": 13, "legend.fontsize": 11}):
        return _figure(name, of, chosen, lengths)


def _figure(name: str, of: Problem, chosen: tuple[str, ...], lengths: list[float]) -> Figure:
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    reference = run(of, "verner9", None, rtol=1e-13, atol=1e-14)
    exact = of.exact(reference.t) if of.exact else reference.y
    runs = {method: [run(of, method, length) for length in lengths] for method in chosen}
    paint = {
        method: {"color": COLOURS[i % 7], "marker": MARKS[i % 7]} for i, method in enumerate(chosen)
    }
    room = ConstrainedLayoutEngine(w_pad=0.12, h_pad=0.1)
    figure = Figure(figsize=(14, 8), layout=room)
    panes = figure.subplot_mosaic("PPEK;PPSW", width_ratios=[1, 1, 1.1, 1.1])
    figure.suptitle(about(name), fontsize=16, wrap=True)
    _paths(panes["P"], of, exact, {m: r[0] for m, r in runs.items()}, paint)
    panes["P"].set_title(f"paths at step {lengths[0]:g}; grey: exact")
    errors = {m: [_error(r, exact[-1]) for r in rs] for m, rs in runs.items()}
    _errors(panes["E"], lengths, errors, paint)
    _kept(panes["K"], of, reference.t, exact, {m: r[0] for m, r in runs.items()}, paint)
    _region(panes["S"], of, chosen[0], lengths[0], exact)
    _effort(panes["W"], runs, errors, paint)
    lines, names = panes["E"].get_legend_handles_labels()
    figure.legend(
        lines, names, loc="outside lower center", ncols=min(len(names), 6), frameon=False,
        fontsize=12, columnspacing=2.0,
    )  # fmt: skip
    return figure


def _error(of: Run, exact: Array) -> float:
    return float(np.linalg.norm(of.y[-1] - exact)) if of.whole else float("nan")


def _paths(axes: Axes, of: Problem, exact: Array, runs: dict[str, Run], paint: Any) -> None:
    shown = np.concatenate([exact[:, list(pair)] for pair in of.axes])
    low, high = shown.min(0), shown.max(0)
    margin = 0.3 * (high - low)
    if of.labels[0] == "t":
        margin[0] /= 10
    elif of.labels == ("x", "y"):  # One scale along both: a circle is round and fills the pane.
        width, height = high - low + 2 * margin.max()
        margin[:] = margin.max()
        margin[0] += max(height * SHAPE - width, 0) / 2
        margin[1] += max(width / SHAPE - height, 0) / 2
    axes.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axes.set_ylim(low[1] - margin[1], high[1] + margin[1])
    if len(of.start) == 2:
        _field(axes, of)
    for i, j in of.axes:
        axes.plot(exact[:, i], exact[:, j], color="0.6", lw=4, zorder=1, solid_capstyle="round")
    marked = 40 if len(of.axes) == 1 else 14
    for number, (method, one) in enumerate(runs.items()):
        every = max(1, len(one.y) // marked)
        for i, j in of.axes:
            x, y = _while_near(one.y[:, [i, j]], low, high).T
            axes.plot(  # Marks of different methods take turns, so that none hides another.
                x, y, lw=1.3, ms=4.5, alpha=0.9,
                markevery=(number * every // len(runs), every), **paint[method],
            )  # fmt: skip
    if of.labels == ("x", "y"):
        axes.set_aspect("equal")
    axes.set_xlabel(of.labels[0])
    axes.set_ylabel(of.labels[1])


def _while_near(path: Array, low: Array, high: Array) -> Array:
    """A path up to where it is gone for good: far outside the frame."""
    far = np.abs(path - (low + high) / 2) > FAR * (high - low)
    gone = np.flatnonzero(far.any(-1))
    return path[: gone[0] + 1] if gone.size else path


def _field(axes: Axes, of: Problem) -> None:
    """The slopes as arrows of equal length."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    x, y = np.meshgrid(np.linspace(left, right, 17), np.linspace(low, high, 17))
    i, j = of.axes[0]
    u, v = np.empty_like(x), np.empty_like(x)
    for place in np.ndindex(x.shape):
        state = np.empty(2)
        state[[i, j]] = x[place], y[place]
        slope = of.f(of.span[0], state)
        u[place], v[place] = slope[i], slope[j]
    size = np.hypot(u, v) + 1e-300
    axes.quiver(x, y, u / size, v / size, color="0.78", angles="xy", zorder=0, width=0.003)


def _errors(axes: Axes, lengths: list[float], errors: dict[str, list[float]], paint: Any) -> None:
    least = min((e for values in errors.values() for e in values if e > 0), default=0.0)
    rounding = least if least < 1e-9 else 0.0
    for method, values in errors.items():
        error = np.array(values)
        good = np.isfinite(error) & (error > 1e-13) & (error < 1e3)
        # The order shows where the error is small, but well above rounding.
        clear = good & (error > 100 * rounding)
        log_h, log_e = np.log(np.array(lengths)[clear]), np.log(error[clear])
        ratios = np.diff(log_e) / np.diff(log_h)
        falling = ratios[ratios > 0.5][-3:]
        slope = "far off"
        if falling.size:  # Where errors change their sign the last alone says little.
            usual, last = float(np.median(falling)), float(falling[-1])
            slope = f"slope {last if abs(last - usual) < 1 else usual:.1f}"
        if not falling.size and (good & ~clear).any():
            slope = "exact to rounding"
        axes.loglog(
            np.array(lengths)[good], error[good], ms=6, lw=1.4, **paint[method],
            label=f"{method}, {slope}",
        )  # fmt: skip
    axes.set_title("error at the end, and its slope")
    texts = [f"{length:.2g}" for length in lengths]
    if max(map(len, texts)) > 6:  # Long numbers need room.
        texts[1::2] = [""] * len(texts[1::2])
    axes.set_xticks(lengths, texts)
    axes.minorticks_off()
    axes.set_xlabel("step")
    axes.grid(alpha=0.3)


def _kept(
    axes: Axes, of: Problem, t: Array, exact: Array, runs: dict[str, Run], paint: Any
) -> None:
    if of.energy is None:
        axes.set_title(f"{of.labels[0] if of.labels[0] != 't' else of.labels[1]} over time")
        place = of.axes[0][1 if of.labels[0] == "t" else 0]
        axes.plot(t, exact[:, place], color="0.6", lw=4)
        low, high = exact[:, place].min(), exact[:, place].max()
        for method, one in runs.items():
            axes.plot(one.t, one.y[:, place], lw=1, color=paint[method]["color"])
        axes.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
    else:
        axes.set_title("error of the energy over time")
        axes.set_yscale("log")
        for method, one in runs.items():
            finite = np.abs(one.y).max(-1) < 1e6
            energy = of.energy(one.y[finite])
            error = np.abs(energy - energy[0]) / max(abs(energy[0]), 1e-300)
            shown = np.maximum(error, 1e-16)[1:]
            axes.plot(one.t[finite][1:], shown, lw=1.2, color=paint[method]["color"])
    axes.set_xlabel("time")
    axes.grid(alpha=0.3)


def _region(axes: Axes, of: Problem, method: str, step: float, exact: Array) -> None:
    """Where one step does not grow, and h lambda along the exact path."""
    places = exact[:: max(1, len(exact) // 20)]
    values = np.concatenate([step * np.linalg.eigvals(_jacobian(of, y)) for y in places])
    reach = max(4.0, min(1.3 * float(np.abs(values).max()), 30.0))
    x, y = np.meshgrid(reach * np.arange(-160, 101) / 100, reach * np.arange(-100, 101) / 100)
    size = growth(find(method))(x + 1j * y)
    # A little more than 1, so that the axis on which splittings are stable can be seen.
    axes.contourf(x, y, size, levels=[0, 1.01], colors=["#cfe6f5"])
    axes.contour(x, y, size, levels=[1.01], colors=[COLOURS[0]], linewidths=1)
    axes.plot(values.real, values.imag, "x", ms=6, color=COLOURS[1])
    axes.axhline(0, color="0.7", lw=0.8)
    axes.axvline(0, color="0.7", lw=0.8)
    axes.set_title(f"{method}: stable where blue")
    axes.set_xlabel("real part (\u00d7: $h \\lambda$ along the path)")
    axes.set_ylabel("imaginary part")
    axes.set_xlim(-1.15 * reach, 0.85 * reach)
    axes.set_ylim(-0.88 * reach, 0.88 * reach)  # The pane's shape, so that the frame stays.
    axes.set_aspect("equal")


def _jacobian(of: Problem, y: Array) -> Array:
    """df/dy by central differences."""
    result = np.empty((y.size, y.size))
    f = partial(of.f, of.span[0])
    for i in range(y.size):
        step = np.zeros_like(y)
        step[i] = 1e-5 * max(1.0, abs(y[i]))
        result[:, i] = (f(y + step) - f(y - step)) / (2 * step[i])
    return result


def _effort(
    axes: Axes, runs: dict[str, list[Run]], errors: dict[str, list[float]], paint: Any
) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    for method, rs in runs.items():
        error = np.array(errors[method])
        good = np.isfinite(error) & (error > 1e-15) & (error < 1e3)
        evaluations = np.array([r.work.evaluations for r in rs])
        axes.loglog(error[good], evaluations[good], ms=6, lw=1.4, **paint[method])
    axes.invert_xaxis()
    axes.xaxis.set_major_locator(LogLocator(numticks=5))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_title("work and precision")
    axes.set_xlabel("error at the end")
    axes.set_ylabel("evaluations")
    axes.grid(alpha=0.3)
