"""A curve as a sum of clamped polynomials, which is the form in which SIMD loops evaluate it.

Between breakpoints b_k and b_k + d_k a curve of time is a polynomial P_k, or close to one. With
w_k = clamp(u - b_k, 0, d_k) it is, everywhere and without a search for u,

    value(u) = v_0 + sum_k (P_k(w_k) - P_k(0)) + sum of the jumps at or before u,

since a piece adds nothing before it begins and its whole rise after it ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motes.control.spline import Spline

Array = NDArray[np.float64]

MOST = 24
"""Pieces of a curve from which a lookup table is cheaper."""

BOUND = 1e-4
"""Largest error of a cubic that stands for a part of a Bezier curve, as a share of the range."""

DEGREE = {"constant": 0, "linear": 1, "smooth": 3, "monotone": 3, "bezier": 3}

_NODES = np.array([1e-12, 0.25, 0.75, 1 - 1e-12])  # Inside, for at its ends a curve may jump.
_TESTS = np.linspace(1 / 32, 31 / 32, 16)
_FIT = np.linalg.inv(_NODES[:, None] ** np.arange(4))


@dataclass(frozen=True)
class Pieces:
    """A curve of c components in k pieces."""

    starts: Array
    """b, (k,)."""
    lengths: Array
    """d, (k,)."""
    first: Array
    """v_0, (c,)."""
    rises: Array
    """Coefficients of w, w^2, w^3 in the order of powers, (k, degree, c)."""
    jumps: Array
    """What is added at b_k, (k, c); the first row is 0."""

    @property
    def jumps_anywhere(self) -> bool:
        """Whether the curve has steps."""
        return bool(np.any(self.jumps))

    def __call__(self, u: Array) -> Array:
        """Values (n, c) at places u (n,): the sum as it stands above."""
        w = np.clip(u[:, None] - self.starts, 0, self.lengths)
        reached = (u[:, None] >= self.starts).astype(float)
        powers = w[:, :, None] ** np.arange(1, self.rises.shape[1] + 1)
        rises = np.einsum("nkp,kpc->nc", powers, self.rises)
        return np.asarray(self.first + rises + reached @ self.jumps)


def pieces(spline: Spline, low: float, high: float) -> Pieces | None:
    """The spline from `low` to `high` in pieces, or None if it would take more than `MOST`.

    Exact up to rounding, but for Bezier handles, where the error is at most `BOUND` of the range.
    """
    degree = DEGREE[spline.interpolation]
    todo = list(_breaks(spline, low, high))
    if len(todo) - 1 > MOST:
        return None
    parts = list(pairwise(todo))
    scale = max(float(np.ptp(_sampled(spline, np.linspace(low, high, 65)))), 1e-30)
    done: list[tuple[float, float, Array]] = []
    while parts:
        a, b = parts.pop(0)
        power = _FIT @ _sampled(spline, a + (b - a) * _NODES)
        fitted = _TESTS[:, None] ** np.arange(4) @ power
        error = np.max(np.abs(fitted - _sampled(spline, a + (b - a) * _TESTS)))
        if 2 * error > BOUND * scale and spline.interpolation == "bezier":
            if len(done) + len(parts) + 2 > MOST:
                return None
            parts[:0] = [(a, (a + b) / 2), ((a + b) / 2, b)]
        else:
            done.append((a, b - a, power / (b - a) ** np.arange(4.0)[:, None]))
    starts, lengths, powers = (np.array(column) for column in zip(*done, strict=True))
    ends = np.einsum("kp,kpc->kc", lengths[:, None] ** np.arange(4), powers)
    jumps = np.zeros_like(powers[:, 0])
    jumps[1:] = powers[1:, 0] - ends[:-1]
    jumps[np.abs(jumps) <= 1e-9 * np.max(np.abs(powers))] = 0
    return Pieces(starts, lengths, powers[0, 0], powers[:, 1 : degree + 1], jumps)


def _sampled(spline: Spline, at: Array) -> Array:
    return np.asarray(spline(at), float).reshape(at.size, -1)


def _breaks(spline: Spline, low: float, high: float) -> Array:
    """Places from `low` to `high` between which the spline is one segment."""
    first, last = spline.times[0], spline.times[-1]
    length = max(last - first, 1e-30)
    found = [spline.times]
    for mode, begin, end in ((spline.before, low, first), (spline.after, last, high)):
        if mode not in ("loop", "pingpong") or end <= begin or last <= first:
            continue
        cycles = np.arange(np.floor((begin - first) / length), np.ceil((end - first) / length))
        if cycles.size > MOST:
            cycles = cycles[: MOST + 1]
        for cycle in cycles:
            inner = spline.times - first
            turned = length - inner if mode == "pingpong" and cycle % 2 else inner
            found.append(first + cycle * length + turned)
    every = np.unique(np.concatenate([*found, [low, high]]))
    every = every[(every >= low) & (every <= high)]
    apart = np.concatenate([[True], np.diff(every) > 1e-12 * max(high - low, 1e-30)])
    return np.asarray(every[apart])
