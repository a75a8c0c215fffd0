"""Piles of spheres come to rest in whole: from the ground up, layer by layer."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import EXACT, jit

if TYPE_CHECKING:
    from motes.group.contacts import Planes
    from motes.interact.collisions import Spheres
    from motes.interact.search import Found

TOUCH = 1e-3
"""Distance, over its size, at which a sphere touches a solid or another sphere."""

STEEP = 0.3
"""Least cosine between the normal of a solid that bears a pile and the way against its weight."""

SWEEPS = 4
"""Rounds for each layer of a pile: a sphere lies on several others."""


def propagate(
    near: Found, spheres: Spheres, period: NDArray[Any], start: NDArray[Any], planes: Planes,
    friction: float,
) -> None:  # fmt: skip
    """Let what rounds have left of approaches end on what stands on solids, layer by layer.

    A sphere's layer is the number of contacts from a solid that bears it: one against which what
    touches moves on the whole. In a contact the lower one does not give way, since the ground bears
    it. So piles come to rest in whole, for which rounds alone would have to be many. Source:
    Guendelman, Bridson and Fedkiw, ACM Transactions on Graphics 22 (2003) 871, section 8.
    """
    x, v, _, size = spheres
    n = size.size
    pairs = np.empty((2, int(near.first[-1])), np.int32)
    layer = np.full(n, n + 1, np.int64)
    touching = _touching(near.first, near.row, x, v, size, period, pairs)
    pairs = pairs[:, :touching]
    _bear(x, v, size, start, *planes, friction, *_press(v, pairs), layer)
    first = np.zeros(n + 2, np.int64)
    deepest = _layers(pairs, first, np.empty(2 * touching, np.int32), np.empty(n, np.int32), layer)
    if deepest:
        spheres_of, pairs_of = (
            _by_layer(np.where(found > deepest, 0, found), deepest)
            for found in (layer, _upper(layer, pairs))
        )
        _settle(
            x, v, size, period, start, *planes, friction, layer, pairs, *spheres_of, *pairs_of
        )  # fmt: skip


def _press(v: NDArray[Any], pairs: NDArray[np.int32]) -> NDArray[Any]:
    """Which way (3,) spheres that touch others move on the whole."""
    way = v[:, pairs[0]].sum(axis=1)
    unit: NDArray[Any] = way / (np.sqrt((way**2).sum()) + 1e-300)
    return unit


def _upper(layer: NDArray[np.int64], pairs: NDArray[np.int32]) -> NDArray[np.int64]:
    """Layer of the upper one of each pair, 0 for pairs of one layer or none."""
    a, b = layer[pairs[0]], layer[pairs[1]]
    return np.where(a == b, 0, np.maximum(a, b))


def _by_layer(layer: NDArray[np.int64], deepest: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Numbers of things in the order of their layers, and where each layer begins."""
    order = np.argsort(layer, kind="stable")
    return order, np.searchsorted(layer[order], np.arange(deepest + 2))


@jit(flags=EXACT)
def _touching(first: Any, row: Any, x: Any, v: Any, size: Any, period: Any, pairs: Any) -> Any:
    """Write the pairs that touch; returns how many."""
    count = np.int64(0)
    for i in range(size.size):
        for e in range(first[i], first[i + 1]):
            far2 = np.float64(0)
            for axis in range(3):
                d = x[axis, i] - x[axis, row[e]]
                d -= period[axis] * np.round(d / period[axis])
                far2 += d * d
            reach = 0.5 * (1 + TOUCH) * (size[i] + size[row[e]])
            if far2 <= reach * reach and far2 > 0:
                pairs[0, count], pairs[1, count] = np.int32(i), row[e]
                count += 1
    return count


@jit(inline=True, flags=EXACT)
def _away(x: Any, i: Any, k: Any, start: Any, gap: Any, normal: Any) -> Any:
    """Distance of a sphere that has been moved from one of its planes."""
    moved = gap[i, k] + (x[0, i] - start[0, i]) * normal[i, k, 0]
    moved += (x[1, i] - start[1, i]) * normal[i, k, 1]
    return moved + (x[2, i] - start[2, i]) * normal[i, k, 2]


@jit(inline=True, flags=EXACT)
def _stopped(v: Any, i: Any, n: Any, u: Any, friction: Any) -> None:
    """Stop a sphere's approach, with a velocity u along -n, to something that does not give way."""
    un = u[0] * n[0] + u[1] * n[1] + u[2] * n[2]
    if un < 0:
        tx, ty, tz = u[0] - un * n[0], u[1] - un * n[1], u[2] - un * n[2]
        ut = np.sqrt(tx * tx + ty * ty + tz * tz)
        rub = min(-friction * un, ut) / ut if ut > 0 else 0.0
        v[0, i] -= un * n[0] + rub * tx
        v[1, i] -= un * n[1] + rub * ty
        v[2, i] -= un * n[2] + rub * tz


@jit(flags=EXACT)
def _bear(
    x: Any, v: Any, size: Any, start: Any, gap: Any, normal: Any, held: Any, friction: Any,
    down_x: Any, down_y: Any, down_z: Any, layer: Any,
) -> None:  # fmt: skip
    """Stop what touches solids; layer 0 is what they bear against the way down."""
    for i in range(held.size):
        for k in range(held[i]):
            nx, ny, nz = normal[i, k, 0], normal[i, k, 1], normal[i, k, 2]
            if _away(x, i, k, start, gap, normal) <= TOUCH * size[i]:
                _stopped(v, i, (nx, ny, nz), (v[0, i], v[1, i], v[2, i]), friction)
                if nx * down_x + ny * down_y + nz * down_z < -STEEP:
                    layer[i] = 0


@jit
def _layers(pairs: Any, first: Any, other: Any, queue: Any, layer: Any) -> Any:
    """Layers of all that stand on layer 0, breadth first; returns the last.

    `first` (n + 2,) and `other` become who touches whom.
    """
    n = layer.size
    for e in range(pairs.shape[1]):
        first[pairs[0, e] + 2] += 1
        first[pairs[1, e] + 2] += 1
    for i in range(n):
        first[i + 2] += first[i + 1]
    for e in range(pairs.shape[1]):
        for side in range(2):
            i = pairs[side, e]
            other[first[i + 1]] = pairs[1 - side, e]
            first[i + 1] += 1
    head, tail = np.int64(0), np.int64(0)
    for i in range(n):
        if layer[i] == 0:
            queue[tail] = np.int32(i)
            tail += 1
    last = np.int64(0)
    while head < tail:
        i = queue[head]
        head += 1
        last = layer[i]
        for e in range(first[i], first[i + 1]):
            j = other[e]
            if layer[j] > n:
                layer[j] = last + 1
                queue[tail] = j
                tail += 1
    return last


@jit(flags=EXACT)
def _settle(
    x: Any, v: Any, size: Any, period: Any, start: Any, gap: Any, normal: Any, held: Any,
    friction: Any, layer: Any, pairs: Any, sphere: Any, spheres: Any, pair: Any, until: Any,
) -> None:  # fmt: skip
    """Stop approaches to what is lower, some rounds for each layer from the ground up.

    Numbers of `sphere` and `pair` are in the order of layers, which begin at `spheres`, `until`.
    """
    for above in range(1, until.size - 1):
        for _ in range(SWEEPS):
            for q in range(spheres[above], spheres[above + 1]):
                i = sphere[q]
                for k in range(held[i]):
                    if _away(x, i, k, start, gap, normal) <= TOUCH * size[i]:
                        n = (normal[i, k, 0], normal[i, k, 1], normal[i, k, 2])
                        _stopped(v, i, n, (v[0, i], v[1, i], v[2, i]), friction)
            for q in range(until[above], until[above + 1]):
                i, j = np.int64(pairs[0, pair[q]]), np.int64(pairs[1, pair[q]])
                up, low = (i, j) if layer[i] > layer[j] else (j, i)
                dx, dy, dz = x[0, up] - x[0, low], x[1, up] - x[1, low], x[2, up] - x[2, low]
                dx -= period[0] * np.round(dx / period[0])
                dy -= period[1] * np.round(dy / period[1])
                dz -= period[2] * np.round(dz / period[2])
                far = np.sqrt(dx * dx + dy * dy + dz * dz)
                u = (v[0, up] - v[0, low], v[1, up] - v[1, low], v[2, up] - v[2, low])
                _stopped(v, up, (dx / far, dy / far, dz / far), u, friction)
