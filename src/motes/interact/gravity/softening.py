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

from motes.interact.gravity.lanes import LANES, inverse_root, maximum
from motes.jit import EXACT, jit
from motes.machine.lanes import bits, choose, rough_inverse_root

SUPPORT = 2.8
"""Support radius of the spline in softenings; beyond it the spline's force is exactly Newton's.

With 2.8, a spline is as deep in its middle as a Plummer law of the same softening.
"""

LAWS = ("newton", "plummer", "spline")


def center_depth(law: str, size: float) -> float:
    """Factor w of the potential at r = 0. `size` as in `pair_law`."""
    return {"newton": 0.0, "plummer": 1.0, "spline": SUPPORT}[law] / (size or 1.0)


LEAST: dict[type, float] = {np.float32: 1e-24, np.float64: 1e-37}
"""Least squared distance that is told from 0, in boxes: the cube of its root is still a number."""

ROUGH = 2.5e-4
"""Rms error of s where it is `rough`, in parts of it."""

FIVE_THIRDS = np.float32(5 / 3)
"""As single precision has it: the law in two terms is then right at its middle."""

SHARP = 16
"""Lanes of processors with an estimate of 1 / root of 14 bits: two terms then do for `fine`."""


def part_of(real: type, rough: bool = False, fine: bool = False) -> float:
    """What a law gives of s: in single precision it is cheaper to leave a factor to the end."""
    return float(FIVE_THIRDS) - 1.0 if _in_two_terms(real, rough, fine) else 1.0


def _in_two_terms(real: type, rough: bool, fine: bool) -> bool:
    return real is np.float32 and not rough and not (fine and LANES < SHARP)


@cache
def pair_law(
    law: str, real: type, guarded: bool = True, rough: bool = False, fine: bool = False
) -> Callable[..., Any]:
    """Compiled function (r2, size) -> (s times `part_of`, w), of lanes of type `real`.

    `size` is a length and its inverse: Plummer's softening, or the spline's support radius. Not
    `guarded`, Newton's law is not a number at r = 0. `rough`, in single precision, takes the
    processor's estimate of 1 / r as it is; `fine` leaves no error but rounding. Sources: Plummer,
    MNRAS 71 (1911) 460; the spline of Monaghan and Lattanzio, A&A 149 (1985) 135, as in Springel,
    Yoshida and White, New Astronomy 6 (2001) 79, equation A1 and its gradient.
    """
    powers = _powers(real, rough, fine)
    if law == "plummer":
        return _plummer(powers)
    if law == "newton":
        return _newton(powers, real, guarded)
    return _spline(powers, real, part_of(real, rough, fine))


def _powers(real: type, rough: bool, fine: bool) -> Callable[..., Any]:
    """Compiled function r2 -> (`part_of` / r^3, 1 / r).

    In single precision both come from an estimate y of 1 / r, wrong by a few 1e-4. That is enough
    where they are `rough`; otherwise with the first terms of a Taylor series in h = 1 - r^2 y^2,
    1 / r = y (3 - r^2 y^2) / 2 and 1 / r^3 = y^3 (5 - 3 r^2 y^2) / 2, wrong by some 1e-7 on average
    where the estimate has 12 bits. `fine` ones have a term in h^2 there.
    """
    a, b, c, one = real(FIVE_THIRDS), real(1.5), real(0.5), real(1)
    d, e = real(15 / 8), real(3 / 8)

    @jit(inline=True, flags=EXACT)
    def in_two_terms(r2: Any) -> Any:
        y = rough_inverse_root(r2)
        y2 = y * y
        return y * (y2 * (a - r2 * y2)), y * (b - c * (r2 * y2))

    @jit(inline=True, flags=EXACT)
    def in_three_terms(r2: Any) -> Any:
        y = rough_inverse_root(r2)
        y2 = y * y
        y3, h = y * y2, one - r2 * y2
        return y3 + y3 * (h * (b + d * h)), y + y * (h * (c + e * h))

    root: Any = rough_inverse_root if real is np.float32 else inverse_root

    @jit(inline=True, flags=EXACT)
    def plain(r2: Any) -> Any:
        y = root(r2)
        return y * y * y, y

    if _in_two_terms(real, rough, fine):
        return in_two_terms  # type: ignore[no-any-return]
    return in_three_terms if fine else plain  # type: ignore[no-any-return]


def _plummer(powers: Callable[..., Any]) -> Callable[..., Any]:
    @jit(inline=True, flags=EXACT)
    def plummer(r2: Any, size: Any) -> Any:
        return powers(r2 + size[0] * size[0])

    return plummer  # type: ignore[no-any-return]


def _newton(powers: Callable[..., Any], real: Any, guarded: bool) -> Callable[..., Any]:
    least, nothing = real(LEAST[real]), real(0)

    @jit(inline=True, flags=EXACT)
    def newton(r2: Any, size: Any) -> Any:
        if not guarded:
            return powers(r2)
        s, w = powers(maximum(r2, least))
        return s, choose(least < r2, w, nothing)

    return newton  # type: ignore[no-any-return]


def _spline(powers: Callable[..., Any], real: Any, part: float) -> Callable[..., Any]:
    """With u = r / size; from u = 1 / 2 on, in powers of 1 - u, from what mass is farther out: the
    paper's powers of u would nearly cancel there."""
    half, one, least = real(0.5), real(1), real(LEAST[real])
    f0, f2, f3 = (real(part * c) for c in (32 / 3, -38.4, 32.0))
    v0, v2, v4, v5 = (real(c) for c in (14 / 5, -16 / 3, 48 / 5, -32 / 5))
    o0, o1, o2, p1 = (real(c) for c in (16.0, -25.6, 32 / 3, -12.8))

    @jit(inline=True, flags=EXACT)
    def inside(r2: Any, s: Any, w: Any, scale: Any) -> Any:
        u = r2 * w * scale
        inner = (f0 + u * u * (f2 + f3 * u)) * (scale * scale * scale)
        depth = (v0 + u * u * (v2 + u * u * (v4 + u * v5))) * scale
        v = one - u
        fourth = v * v * v * v
        farther = fourth * (o0 + v * (o1 + v * o2))
        is_inner = u < half
        outer = w - w * farther + fourth * (o0 + v * p1) * scale
        return choose(is_inner, inner, s - s * farther), choose(is_inner, depth, outer)

    @jit(inline=True, flags=EXACT)
    def spline(r2: Any, size: Any) -> Any:
        s, w = powers(maximum(r2, least))
        near = r2 < size[0] * size[0]
        if bits(near) != 0:
            # Few pairs are this close, and those that are, are so together.
            factor, depth = inside(r2, s, w, size[1])
            s, w = choose(near, factor, s), choose(near, depth, w)
        return s, w

    return spline  # type: ignore[no-any-return]
