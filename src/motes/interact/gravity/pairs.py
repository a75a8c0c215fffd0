"""Sums over all pairs of a block of targets and a block of sources: the innermost loop."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from motes.interact.gravity.lanes import LANES, maximum, read
from motes.interact.gravity.softening import pair_law, part_of
from motes.jit import EXACT, jit
from motes.machine.lanes import largest, total

AWAY = 1e18
"""Where a particle is while it is the target, so that it does not pull itself."""


@cache
def attraction(
    law: str, real: type, potential: bool, bound: bool = False, rough: bool = False
) -> Callable[..., Any]:
    """Compiled function that adds the pull of sources on targets, `rough` as in `pair_law`.

    (target (3, a), a, source (4, b), b, own, size, out (5, a)) -> None: rows x, y, z, m; b is a
    multiple of LANES. Target i is source i + own[2] if own[0] <= i < own[1]. Adds to rows 0 to 2 of
    `out` the sums of m s dx, and with `potential` to row 4 those of m w.

    With `bound`, row 3 becomes the largest m s if it was less, and where two points that are not
    the same have the same coordinates, the sums are not numbers. The source that is the target is
    left out then; otherwise it has no force, but a potential.
    """
    pair = pair_law(law, real, not bound, rough)
    zero, one, away, whole = real(0), real(1), real(AWAY), real(1 / part_of(real, rough))

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
            ax = ay = az = depth = most = zero
            for j in range(0, sources, LANES):
                dx, dy, dz, m = read(xs, j) - x, read(ys, j) - y, read(zs, j) - z, read(ms, j)
                s, w = pair(dx * dx + dy * dy + dz * dz, sizes)
                s = s * m
                ax, ay, az = ax + s * dx, ay + s * dy, az + s * dz
                if bound:
                    most = maximum(s, most)
                if potential:
                    depth = depth + w * m
            if itself:
                xs[place] = kept
            out[0, i] += total(ax) * whole
            out[1, i] += total(ay) * whole
            out[2, i] += total(az) * whole
            if bound:
                out[3, i] = max(out[3, i], largest(most) * whole)
            if potential:
                out[4, i] += total(depth)

    return attract  # type: ignore[no-any-return]
