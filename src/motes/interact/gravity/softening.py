"""How gravity is weakened at short range.

A law gives, for squared distance r^2, the factor s in a = G m s (x_source - x_target) and the
factor w in the potential phi = -G m w. Newton: s = 1/r^3, w = 1/r, and both 0 at r = 0.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from motes.jit import jit

SUPPORT = 2.8
"""Support radius of the spline in softenings; beyond it the spline's force is exactly Newton's.

With 2.8, a spline is as deep in its middle as a Plummer law of the same softening.
"""

TINY = np.float32(1e-37)
"""Least normal number of single precision, nearly."""

LAWS = ("newton", "plummer", "spline")


def center_depth(law: str, size: float) -> float:
    """Factor w of the potential at r = 0. `size` as in `pair_law`."""
    return {"newton": 0.0, "plummer": 1.0, "spline": SUPPORT}[law] / (size or 1.0)


@cache
def pair_law(law: str, real: type) -> Callable[..., Any]:
    """Compiled function (r2, size) -> (s, w) for numbers of type `real`.

    `size` is a length: Plummer's softening, or the spline's support radius. Sources: Plummer,
    MNRAS 71 (1911) 460; the spline of Monaghan and Lattanzio, A&A 149 (1985) 135, as in Springel,
    Yoshida and White, New Astronomy 6 (2001) 79, equation A1 and its gradient.
    """
    return {"newton": _newton, "plummer": _plummer, "spline": _spline}[law](real)


def _inverse_root(real: type) -> Callable[..., Any]:
    """Compiled function 1 / sqrt(x), 0 where x = 0 (or under 1e-37).

    In double precision the estimate comes from single precision, where processors have a fast one,
    and one step of Householder's third-order iteration brings its 22 bits to 53.
    """
    single_zero, single_one = np.float32(0), np.float32(1)

    @jit(inline=True)
    def single(x: Any) -> Any:
        return single_one / np.sqrt(x) if x > single_zero else single_zero

    @jit(inline=True)
    def double(x: Any) -> Any:
        near = np.float32(x)
        y = np.float64(single_one / np.sqrt(near)) if near > TINY else 0.0
        h = 1.0 - x * y * y
        return y + y * h * (0.5 + 0.375 * h)

    return single if real is np.float32 else double  # type: ignore[no-any-return]


def _newton(real: type) -> Callable[..., Any]:
    inverse_root = _inverse_root(real)

    @jit(inline=True)
    def newton(r2: Any, size: Any) -> Any:
        inverse = inverse_root(r2)
        return inverse * inverse * inverse, inverse

    return newton  # type: ignore[no-any-return]


def _plummer(real: type) -> Callable[..., Any]:
    inverse_root = _inverse_root(real)

    @jit(inline=True)
    def plummer(r2: Any, size: Any) -> Any:
        inverse = inverse_root(r2 + size * size)
        return inverse * inverse * inverse, inverse

    return plummer  # type: ignore[no-any-return]


def _spline(real: type) -> Callable[..., Any]:
    half, one = real(0.5), real(1)
    inverse_root = _inverse_root(real)
    f0, f2, f3 = real(32 / 3), real(-38.4), real(32)
    g_, g0, g1, g2, g3 = real(-1 / 15), real(64 / 3), real(-48), real(38.4), real(-32 / 3)
    v0, v2, v4, v5 = real(14 / 5), real(-16 / 3), real(48 / 5), real(-32 / 5)
    w_, w0, w2, w3, w4, w5 = (real(c) for c in (-1 / 15, 16 / 5, -32 / 3, 16.0, -48 / 5, 32 / 15))

    @jit(inline=True)
    def spline(r2: Any, size: Any) -> Any:
        inverse = inverse_root(r2)
        scale = one / size
        u = r2 * inverse * scale
        v = inverse * size
        inner = f0 + u * u * (f2 + f3 * u)
        outer = g_ * v * v * v + g0 + u * (g1 + u * (g2 + u * g3))
        factor = (inner if u < half else outer) * (scale * scale * scale)
        s = factor if u < one else inverse * inverse * inverse
        inner = v0 + u * u * (v2 + u * u * (v4 + u * v5))
        outer = w_ * v + w0 + u * u * (w2 + u * (w3 + u * (w4 + u * w5)))
        depth = (inner if u < half else outer) * scale
        return s, depth if u < one else inverse

    return spline  # type: ignore[no-any-return]
