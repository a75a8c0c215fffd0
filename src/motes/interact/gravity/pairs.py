"""Sums over all pairs of a block of targets and a block of sources: the innermost loop."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from motes.interact.gravity.lanes import LANES, maximum, read
from motes.interact.gravity.softening import pair_law, part_of
from motes.jit import EXACT, jit
from motes.machine.lanes import largest, total

AWAY = 1e18
"""Where a particle is while it is the target, so that it does not pull itself."""

RUN, ENDLESS = 32 * LANES, 1 << 40
"""Sources whose sums are added up in double precision, where they are to be `fine`, and elsewhere:
each sum in single precision is over as many pairs as one lane has then."""


@cache
def attraction(
    law: str,
    real: type,
    potential: bool,
    bound: bool = False,
    rough: bool = False,
    fine: bool = False,
) -> Callable[..., Any]:
    """Compiled function that adds the pull of sources on targets, `rough` as in `pair_law`.

    (target (3, a), a, source (4, b), b, own, size, out (5, a)) -> None: rows x, y, z, m; b is a
    multiple of LANES. Target i is source i + own[2] if own[0] <= i < own[1]. Adds to rows 0 to 2 of
    `out` the sums of m s dx, and with `potential` to row 4 those of m w.

    With `bound`, row 3 becomes the largest m s if it was less, and where two points that are not
    the same have the same coordinates, the sums are not numbers. The source that is the target is
    left out then; otherwise it has no force, but a potential.

    `fine`, in single precision, has coordinates in two parts: target (6, a) and source (7, b) have
    three more rows, of what the first ones lack. Differences are then as exact as the pair law,
    however close two points are; `out` is in double precision.
    """
    pair = pair_law(law, real, not bound, rough, fine)
    zero, one, away, whole = real(0), real(1), real(AWAY), 1.0 / part_of(real, rough, fine)
    wide: Any = np.float64 if fine else real
    run = RUN if fine else ENDLESS

    @jit(flags=EXACT, numba=False)
    def attract(
        target: Any, targets: Any, source: Any, sources: Any, own: Any, size: Any, out: Any
    ) -> None:
        xs, ys, zs, ms = source[0], source[1], source[2], source[3]
        sizes = size, one / size if size > zero else zero
        for i in range(targets):
            itself = bound and own[0] <= i < own[1]
            place = i + own[2] if itself else 0
            kept = xs[place]
            if itself:
                xs[place] = away
            x, y, z = target[0, i], target[1, i], target[2, i]
            sum_x = sum_y = sum_z = sum_w = wide(0.0)
            most = zero
            for first in range(0, sources, run):
                ax = ay = az = depth = zero
                for j in range(first, min(first + run, sources), LANES):
                    dx, dy, dz, m = read(xs, j) - x, read(ys, j) - y, read(zs, j) - z, read(ms, j)
                    if fine:
                        dx = dx + (read(source[4], j) - target[3, i])
                        dy = dy + (read(source[5], j) - target[4, i])
                        dz = dz + (read(source[6], j) - target[5, i])
                    s, w = pair(dx * dx + dy * dy + dz * dz, sizes)
                    s = s * m
                    ax, ay, az = ax + s * dx, ay + s * dy, az + s * dz
                    if bound:
                        most = maximum(s, most)
                    if potential:
                        depth = depth + w * m
                sum_x, sum_y, sum_z = sum_x + wide(ax), sum_y + wide(ay), sum_z + wide(az)
                if potential:
                    sum_w = sum_w + wide(depth)
            if itself:
                xs[place] = kept
            out[0, i] += total(sum_x) * whole
            out[1, i] += total(sum_y) * whole
            out[2, i] += total(sum_z) * whole
            if bound:
                out[3, i] = max(out[3, i], largest(most) * whole)
            if potential:
                out[4, i] += total(sum_w)

    if isinstance(attract, FunctionType):
        # Plain Python: as in machine code, what overflows or is 0 / 0 is no fault.
        return np.errstate(all="ignore")(attract)
    return attract  # type: ignore[no-any-return]
