"""Sums over all pairs of a block of targets and a block of sources: the innermost loop."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from motes.interact.gravity.softening import pair_law
from motes.jit import jit

TILE = 4
"""Targets that share each load of a source; their sums and coordinates fill the registers."""


@cache
def attraction(law: str, real: type, potential: bool, bound: bool = False) -> Callable[..., Any]:
    """Compiled function that adds the pull of sources on targets.

    (target (3, a), a, xs, ys, zs, ms, wrongs, size, alarm, total (5, a)) -> None, the sources as
    columns (b,); a is rounded up to a multiple of TILE. Adds to rows 0 to 2 of `total` the sums of
    m s dx, and with `potential` to row 4 those of m w.

    With `bound`, `wrongs` are m |d(dx)| of coordinates that are wrong by |d(dx)|, and row 3 becomes
    the sum of that times s: half of what |d(m s dx)| may be. There, a pair whose coordinates are
    equal counts as `alarm`, as they may be equal by rounding.
    """
    pair = pair_law(law, real)
    zero = real(0)

    @jit(inline=True)
    def pull(dx: Any, dy: Any, dz: Any, m: Any, wrong: Any, size: Any, alarm: Any) -> Any:
        r2 = dx * dx + dy * dy + dz * dz
        s, w = pair(r2, size)
        change = s * wrong if r2 > zero else alarm
        s *= m
        return s * dx, s * dy, s * dz, change, w * m

    @jit
    def attract(
        target: Any, targets: Any, xs: Any, ys: Any, zs: Any, ms: Any, wrongs: Any, size: Any,
        alarm: Any, total: Any,
    ) -> None:  # fmt: skip
        for i in range(0, targets, TILE):
            x0, y0, z0 = target[0, i], target[1, i], target[2, i]
            x1, y1, z1 = target[0, i + 1], target[1, i + 1], target[2, i + 1]
            x2, y2, z2 = target[0, i + 2], target[1, i + 2], target[2, i + 2]
            x3, y3, z3 = target[0, i + 3], target[1, i + 3], target[2, i + 3]
            a0 = b0 = c0 = d0 = e0 = a1 = b1 = c1 = d1 = e1 = zero
            a2 = b2 = c2 = d2 = e2 = a3 = b3 = c3 = d3 = e3 = zero
            for j in range(xs.size):
                x, y, z, m, wrong = xs[j], ys[j], zs[j], ms[j], wrongs[j]
                a, b, c, d, e = pull(x - x0, y - y0, z - z0, m, wrong, size, alarm)
                a0, b0, c0, d0, e0 = a0 + a, b0 + b, c0 + c, d0 + d, e0 + e
                a, b, c, d, e = pull(x - x1, y - y1, z - z1, m, wrong, size, alarm)
                a1, b1, c1, d1, e1 = a1 + a, b1 + b, c1 + c, d1 + d, e1 + e
                a, b, c, d, e = pull(x - x2, y - y2, z - z2, m, wrong, size, alarm)
                a2, b2, c2, d2, e2 = a2 + a, b2 + b, c2 + c, d2 + d, e2 + e
                a, b, c, d, e = pull(x - x3, y - y3, z - z3, m, wrong, size, alarm)
                a3, b3, c3, d3, e3 = a3 + a, b3 + b, c3 + c, d3 + d, e3 + e
            for k, sums in enumerate(
                (
                    (a0, b0, c0, d0, e0),
                    (a1, b1, c1, d1, e1),
                    (a2, b2, c2, d2, e2),
                    (a3, b3, c3, d3, e3),
                )
            ):
                total[0, i + k] += sums[0]
                total[1, i + k] += sums[1]
                total[2, i + k] += sums[2]
                if bound:
                    total[3, i + k] += sums[3]
                if potential:
                    total[4, i + k] += sums[4]

    return attract  # type: ignore[no-any-return]
