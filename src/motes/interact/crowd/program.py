"""The velocity nearest to the wanted one that all half-planes allow: a linear program in 2D.

Constraints are added one after another. While the best velocity so far satisfies the next one it
stays; where not, the new best lies on that one's border, which is a search in one dimension
(Seidel; de Berg et al., Computational Geometry, section 4.4). Where nothing satisfies all, walls
stay, and the greatest violation of the others becomes as small as it can be (van den Berg et al.
2011, section 5.3).
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import STRICT, jit

PARALLEL = 1e-9
"""Sine of the angle between two borders below which they do not meet."""


@jit(flags=STRICT)
def _on_border(planes: Any, i: Any, top: Any, gx: Any, gy: Any, far: Any) -> Any:
    """The best point of border i within the half-planes before it and the disc of radius `top`.

    The best is nearest to g, or with `far` the farthest along g. Returns (found, x, y).
    """
    nx, ny, c = planes[i, 0], planes[i, 1], planes[i, 2]
    reach2 = top * top - c * c
    if not reach2 >= 0.0:
        return False, 0.0, 0.0
    high = np.sqrt(reach2)
    low = -high
    x, y, dx, dy = c * nx, c * ny, ny, -nx
    for j in range(i):
        slope = planes[j, 0] * dx + planes[j, 1] * dy
        gap = planes[j, 2] - planes[j, 0] * x - planes[j, 1] * y
        if abs(slope) <= PARALLEL:
            if gap > 0.0:
                return False, 0.0, 0.0
        elif slope > 0.0:
            low = max(low, gap / slope)
        else:
            high = min(high, gap / slope)
        if low > high:
            return False, 0.0, 0.0
    along = gx * dx + gy * dy
    if far:
        s = high if along > 0.0 else low
    else:
        s = min(max(along, low), high)
    return True, x + s * dx, y + s * dy


@jit(flags=STRICT)
def _best(planes: Any, count: Any, top: Any, gx: Any, gy: Any, far: Any) -> Any:
    """The best velocity, and the first half-plane that cannot be satisfied, or `count`."""
    length = np.sqrt(gx * gx + gy * gy)
    x, y = gx, gy
    if far or length > top:
        scale = top / length if length > 0.0 else 0.0
        x, y = gx * scale, gy * scale
    for i in range(count):
        if planes[i, 0] * x + planes[i, 1] * y < planes[i, 2]:
            found, a, b = _on_border(planes, i, top, gx, gy, far)
            if not found:
                return x, y, i
            x, y = a, b
    return x, y, count


@jit(flags=STRICT)
def velocity(planes: Any, walls: Any, count: Any, top: Any, gx: Any, gy: Any, room: Any) -> Any:
    """The velocity (x, y) nearest to g, of at most `top` [m/s], within half-planes (count, 3).

    The first `walls` of them hold in any case: where rounding leaves nothing between them, as in a
    jam, the agent stands. `room` (count, 3) is overwritten.
    """
    x, y, failed = _best(planes, count, top, gx, gy, False)
    if failed < walls:
        x, y, failed = 0.0, 0.0, walls
    worst = 0.0
    for i in range(failed, count):
        violation = planes[i, 2] - planes[i, 0] * x - planes[i, 1] * y
        if violation <= worst:
            continue
        for j in range(walls):
            for k in range(3):
                room[j, k] = planes[j, k]
        held = walls
        for j in range(walls, i):  # Where half-plane j is violated no more than i.
            dx, dy = planes[j, 0] - planes[i, 0], planes[j, 1] - planes[i, 1]
            length = np.sqrt(dx * dx + dy * dy)
            if length > PARALLEL:
                room[held, 0], room[held, 1] = dx / length, dy / length
                room[held, 2] = (planes[j, 2] - planes[i, 2]) / length
                held += 1
        a, b, stuck = _best(room, held, top, planes[i, 0], planes[i, 1], True)
        if stuck == held:
            x, y = a, b
        worst = planes[i, 2] - planes[i, 0] * x - planes[i, 1] * y
    return x, y
