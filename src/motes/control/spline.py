"""Curves of time through keys: piecewise cubic Bezier splines as animation tools have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Interpolation = Literal["linear", "constant", "smooth", "monotone", "bezier"]
Beyond = Literal["hold", "loop", "pingpong", "extend"]


@dataclass(frozen=True, eq=False)
class Spline:
    """A curve through keys: between two of them, time and value are cubics in a parameter.

    Parameters
    ----------
    times : (k,) increasing [s].
    values : (k,) for a scalar curve, (k, c) for one of c components.
    interpolation : "linear"; "constant" (a key's value up to the next key); "smooth" (automatic
        tangents, flat at the ends and at local extrema, so that no segment leaves the range of
        its two keys); "monotone" (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980, with the
        weighted harmonic mean of Fritsch and Butland, 1984); "bezier" (handles).
    before, after : what lies beyond the first and last key: "hold" (their values), "loop",
        "pingpong" (there and back), "extend" (a straight line of the end's slope).
    handles : (k, 2, 1 + c), for "bezier": each key's left and right handle as an offset
        (dt, dv...) from the key. They are shortened along their direction until they stay within
        their segment, so that time never runs backwards.

    Raises ValueError for keys that make no curve.
    """

    times: Array
    values: Array
    interpolation: Interpolation = "linear"
    before: Beyond = "hold"
    after: Beyond = "hold"
    handles: Array | None = None

    def __init__(
        self,
        times: ArrayLike,
        values: ArrayLike,
        interpolation: Interpolation = "linear",
        *,
        before: Beyond = "hold",
        after: Beyond = "hold",
        handles: ArrayLike | None = None,
    ) -> None:
        fields: dict[str, Any] = {
            "times": _frozen("times", times),
            "values": _frozen("values", values),
            "interpolation": interpolation,
            "before": before,
            "after": after,
            "handles": None if handles is None else _frozen("handles", handles),
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        self._check()

    def _check(self) -> None:
        times, values = self.times, self.values
        if times.ndim != 1 or times.size == 0:
            raise ValueError("a spline needs at least one key")
        if values.ndim not in (1, 2) or len(values) != times.size:
            raise ValueError(
                f"a spline with {times.size} times needs as many values, not an array of shape "
                f"{values.shape}"
            )
        if (wrong := np.flatnonzero(np.diff(times) <= 0)).size:
            i = int(wrong[0])
            raise ValueError(
                f"times of keys must increase, but key {i + 1} is at {times[i]:g} and "
                f"key {i + 2} at {times[i + 1]:g}"
            )
        _choose("interpolation", self.interpolation, get_args(Interpolation))
        _choose("before", self.before, get_args(Beyond))
        _choose("after", self.after, get_args(Beyond))
        if (self.handles is not None) != (self.interpolation == "bezier"):
            raise ValueError('interpolation "bezier" needs handles, and no other takes them')
        shape = (times.size, 2, 1 + self._columns.shape[1])
        if self.handles is not None and self.handles.shape != shape:
            raise ValueError(
                f"handles need shape {shape}, left and right (dt, dv...) for each key, "
                f"not {self.handles.shape}"
            )

    @property
    def _columns(self) -> Array:
        return self.values.reshape(self.times.size, -1)

    def __call__(self, t: ArrayLike) -> Any:
        """Value at times t [s]: the shape of t, then the components."""
        from motes.control import spline_kernels

        return self._evaluated(spline_kernels.values, t)

    def integral(self, t: ArrayLike) -> Any:
        """Integral over time from 0 to t, exact up to rounding; the shape is as for values."""
        from motes.control import spline_kernels

        return self._evaluated(spline_kernels.integrals, t)

    def when(self, amounts: ArrayLike) -> Any:
        """Earliest times t >= 0 at which `integral(t)` reaches amounts; infinity if it never does.

        Raises ValueError if the spline has components or is negative somewhere.
        """
        if self.values.ndim != 1:
            raise ValueError("only the integral of a scalar spline has an inverse")
        lowest, highest = self.bounds()
        if lowest < -1e-12 * abs(highest):  # A minimum of 0 may come out as a rounding error.
            raise ValueError(
                f"a rate must not be negative, but this spline goes down to {lowest:g}"
            )
        from motes.control import spline_kernels

        return self._evaluated(spline_kernels.instants, amounts)

    def _evaluated(self, kernel: Callable[..., None], at: ArrayLike) -> Any:
        points = np.asarray(at, np.float64)
        flat = np.ascontiguousarray(points).reshape(-1)
        out = np.empty((len(self._tables), flat.size))
        for table, row in zip(self._tables, out, strict=True):
            kernel(table, flat, row)
        result = out.T.reshape(points.shape + self.values.shape[1:])
        return result if result.ndim else float(result)

    def bounds(self) -> tuple[Any, Any]:
        """Least and greatest value over all time, for each component; infinite if extended so."""
        rows = self._tables[:, 1:]
        v0, v1, v2, v3 = (rows[..., 5 + i] for i in range(4))
        candidates = [self._columns.T]
        with np.errstate(divide="ignore", invalid="ignore"):
            # The roots of v1 + 2 v2 u + 3 v3 u^2, both without cancellation.
            q = -(v2 + np.copysign(np.sqrt(v2 * v2 - 3 * v3 * v1), v2))
            for u in (q / (3 * v3), v1 / q):
                inside = np.where((u > 0) & (u < 1), u, 0.0)
                candidates.append(v0 + inside * (v1 + inside * (v2 + inside * v3)))
        every = np.concatenate(candidates, axis=1)
        low, high = every.min(axis=1), every.max(axis=1)
        head = self._tables[:, 0]
        for mode, outward in ((self.before, -head[:, 6]), (self.after, head[:, 7])):
            if mode == "extend":
                low = np.where(outward < 0, -np.inf, low)
                high = np.where(outward > 0, np.inf, high)
        if self.values.ndim == 1:
            return float(low[0]), float(high[0])
        return low, high

    def packed(self) -> Array:
        """Table for `spline_kernels.spline_at`: (rows, 10), with a first axis for components."""
        return self._tables[0] if self.values.ndim == 1 else self._tables

    def sampled(self, count: int) -> Array:
        """Values at `count` evenly spaced times from the first key to the last."""
        return np.asarray(self(np.linspace(self.times[0], self.times[-1], count)))

    @cached_property
    def _tables(self) -> Array:
        """(components, 1 + segments, 10), laid out as `spline_kernels` says."""
        times, values = self.times, self._columns.T
        segments = max(times.size - 1, 1)
        tables = np.zeros((len(values), 1 + segments, 10))
        rows, head = tables[:, 1:], tables[:, 0]
        rows[..., 0] = times[:segments]
        rows[..., 1] = np.diff(times) if times.size > 1 else 1.0
        rows[..., 2] = 1.0
        rows[..., 5] = values[:, :segments]
        if times.size > 1 and self.interpolation != "constant":
            self._fill_cubics(rows, head, values)
        totals = np.cumsum(_segment_integrals(rows), axis=1)
        rows[:, 1:, 9] = totals[:, :-1]
        codes = dict(zip(get_args(Beyond), range(4), strict=True))
        if times.size == 1:
            codes = dict.fromkeys(codes, 0)
        else:
            head[:, 8] = totals[:, -1]
        head[:, 0], head[:, 1] = times[0], times[-1]
        head[:, 2], head[:, 3] = codes[self.before], codes[self.after]
        head[:, 4], head[:, 5] = values[:, 0], values[:, -1]
        tables.setflags(write=False)
        return tables

    def _fill_cubics(self, rows: Array, head: Array, values: Array) -> None:
        """Write each segment's cubics of time and value, and the slopes at the ends."""
        step, rise = np.diff(self.times), np.diff(values)
        start_rate = end_rate = np.ones_like(step)
        if self.interpolation == "linear":
            rows[..., 6] = rise
            start, end = rise, rise
        else:
            if self.handles is not None:
                start_rate, start = _handle_rates(self.handles[:-1, 1], step)
                end_rate, end = _handle_rates(-self.handles[1:, 0], step)
            else:
                tangents = _smooth if self.interpolation == "smooth" else _monotone
                slopes = tangents(step, rise)
                start, end = slopes[:, :-1] * step, slopes[:, 1:] * step
            # Hermite to power form, for time (which rises by 1) and value.
            rows[..., 2] = start_rate
            rows[..., 3] = 3 - 2 * start_rate - end_rate
            rows[..., 4] = start_rate + end_rate - 2
            rows[..., 6] = start
            rows[..., 7] = 3 * rise - 2 * start - end
            rows[..., 8] = start + end - 2 * rise
        # A vertical handle has no slope to extend.
        if start_rate[0] > 0:
            head[:, 6] = start[:, 0] / (step[0] * start_rate[0])
        if end_rate[-1] > 0:
            head[:, 7] = end[:, -1] / (step[-1] * end_rate[-1])


def _frozen(name: str, numbers: ArrayLike) -> Array:
    """A read-only float64 copy of finite numbers."""
    array = np.array(numbers, np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"the {name} of a spline must be finite numbers")
    array.setflags(write=False)
    return array


def _choose(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f'{name} = "{value}" is not one of {", ".join(choices)}')


def _segment_integrals(rows: Array) -> Array:
    """Integral of each segment: value times time's rate, a polynomial of degree 5, over [0, 1]."""
    rates = [rows[..., 2], 2 * rows[..., 3], 3 * rows[..., 4]]
    total = np.zeros(rows.shape[:-1])
    for i in range(4):
        for j, rate in enumerate(rates):
            total += rows[..., 5 + i] * rate / (i + j + 1)
    return total * rows[..., 1]


def _handle_rates(handles: Array, step: Array) -> tuple[Array, Array]:
    """Rates in the parameter of time (as a share of the step) and value that handles stand for."""
    dt = np.clip(handles[:, 0], 0.0, step)
    shrink = np.where(handles[:, 0] > step, step / np.maximum(handles[:, 0], step), 1.0)
    return 3 * (dt / step), 3 * (shrink[:, None] * handles[:, 1:]).T


def _smooth(step: Array, rise: Array) -> Array:
    """Slopes at the keys: central differences, held within three times the flatter neighbour.

    That bound keeps every segment monotone (Fritsch and Carlson 1980, region of figure 1).
    """
    secant = rise / step
    slopes = np.zeros((len(rise), step.size + 1))
    central = (rise[:, 1:] + rise[:, :-1]) / (step[1:] + step[:-1])
    before, after = secant[:, :-1], secant[:, 1:]
    limit = np.where(before * after > 0, 3 * np.minimum(abs(before), abs(after)), 0.0)
    slopes[:, 1:-1] = np.clip(central, -limit, limit)
    return slopes


def _monotone(step: Array, rise: Array) -> Array:
    """Slopes at the keys: weighted harmonic means of the neighbours, 0 at local extrema."""
    secant = rise / step
    if step.size == 1:
        return np.repeat(secant, 2, axis=1)
    before, after = secant[:, :-1], secant[:, 1:]
    first, second = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    same = before * after > 0
    weighted = first / np.where(same, before, 1.0) + second / np.where(same, after, 1.0)
    slopes = np.zeros((len(rise), step.size + 1))
    slopes[:, 1:-1] = np.where(same, (first + second) / weighted, 0.0)
    slopes[:, 0] = _end_slope(step[0], step[1], secant[:, 0], secant[:, 1])
    slopes[:, -1] = _end_slope(step[-1], step[-2], secant[:, -1], secant[:, -2])
    return slopes


def _end_slope(near: float, far: float, secant: Array, next_secant: Array) -> Array:
    """Slope at an end of the parabola through three keys, limited so that it stays monotone."""
    slope = ((2 * near + far) * secant - near * next_secant) / (near + far)
    slope = np.where(slope * secant <= 0, 0.0, slope)
    turns = (secant * next_secant < 0) & (abs(slope) > 3 * abs(secant))
    return np.where(turns, 3 * secant, slope)
