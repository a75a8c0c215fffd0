"""Opaque solids: planes met exactly, the others by sphere tracing of a distance function.

The tracer steps along each ray by the distance to the nearest surface, and a little farther where
the last steps show the surface to be flat (Balint and Valasek 2018); when two such spheres of empty
space turn out not to overlap it steps back, so nothing is jumped over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import jit
from motes.renderer.camera import Vector

Array = NDArray[np.float32]

FAR = 1000.0
"""Solids other than planes are lost in the haze beyond this [m]."""

_ZERO = np.float32(0)
_ONE = np.float32(1)
_FAR = np.float32(FAR)
_TINY = np.float32(1e-30)
_DARK = np.float32(1 / 64)
_NOTHING = np.float32(np.inf)
_CLOSE = np.float32(0.5)
_TENTH = np.float32(0.1)
_NINE_TENTHS = np.float32(0.9)
_SHADOW_FAR = np.float32(50)
_STEPS = 160
_SHADOW_STEPS = 40

LANES = np.uint64(16)
"""Rays that are followed at once."""

# Rows of lanes: the way so far is the first; then its end, or the light that is left; the last
# step, and the distance where it began; where the ray starts, its direction, the normal of what it
# met; the point at which the distance is asked, and the distance. Unsigned, because an index that
# may be negative keeps a loop from becoming SIMD.
_END, _STEP, _BEFORE = (np.uint64(row) * LANES for row in (1, 2, 3))
_LIGHT = _END
_FROM, _FROM_Y, _FROM_Z = (np.uint64(row) * LANES for row in (4, 5, 6))
_ALONG, _ALONG_Y, _ALONG_Z = (np.uint64(row) * LANES for row in (7, 8, 9))
_NORMAL, _NORMAL_Y, _NORMAL_Z = (np.uint64(row) * LANES for row in (10, 11, 12))
_AXES = np.uint64(3)
_AT, _AT_Y, _AT_Z, _FOUND = (np.uint64(row) * LANES for row in (13, 14, 15, 16))
_SINGLE = np.uint64(1)
_ALL = np.uint64(17) * LANES


@dataclass(frozen=True, eq=False)
class Solids:
    """Solids as one distance function, and planes, which reach to the horizon.

    Two are equal where they draw the same picture, which is what a `Renderer` asks before it traces
    them again.
    """

    nearest: Callable[..., Any] | None
    """Inline kernel (params, x, y, z) -> (distance to the nearest surface [m], its index); None
    where there are planes alone."""

    params: NDArray[np.floating]
    """(p,) numbers that `nearest` reads."""

    colors: Array
    """(k, 3) linear colour of the solid of each index, those of the planes last."""

    planes: Array = field(default_factory=lambda: np.empty((0, 4), np.float32))
    """(m, 4) unit normal n and offset [m]: outside, n . x > offset."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "params", np.ascontiguousarray(self.params))
        object.__setattr__(self, "planes", np.asarray(self.planes, np.float32).reshape(-1, 4))
        colors = np.ascontiguousarray(self.colors, np.float32)
        if colors.ndim != 2 or colors.shape[1] != 3:
            raise ValueError(f"colors must have the shape (k, 3), not {colors.shape}")
        object.__setattr__(self, "colors", colors)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Solids):
            return NotImplemented
        return (
            self.nearest is other.nearest
            and np.array_equal(self.params, other.params, equal_nan=True)
            and np.array_equal(self.colors, other.colors)
            and np.array_equal(self.planes, other.planes, equal_nan=True)
        )

    @property
    def bent(self) -> int:
        """How many indices belong to `nearest`; those of the planes follow."""
        return len(self.colors) - len(self.planes)

    def hide(self, sun: Array) -> bool:
        """Whether a plane is between everything and a far light in the direction `sun` (3,)."""
        return bool((self.planes[:, :3] @ sun < 0).any())

    def meet_planes(self, position: Vector, rays: Array, near: float, into: Hits) -> None:
        """Write where rays (n, 3) meet planes beyond `near` and before `into.distance`."""
        for index, (x, y, z, offset) in enumerate(self.planes, self.bent):
            normal = np.array([x, y, z])
            height = np.float32(normal @ np.asarray(position) - offset)
            with np.errstate(all="ignore"):
                distance = -height / (rays @ normal)
            met = (height > 0) & (distance > near) & (distance < into.distance)
            np.copyto(into.distance, distance, where=met)
            np.copyto(into.normal, normal, where=met[:, None])
            np.copyto(into.index, index, where=met)


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays met."""

    distance: Array
    """(n,) along the ray [m]; infinite where it met nothing."""

    normal: Array
    """(n, 3) outward unit normal."""

    index: NDArray[np.int32]
    """(n,) which solid; -1 for none."""

    lit: Array
    """(n,) part of the sun that is seen from there."""

    @classmethod
    def empty(cls, n: int) -> Hits:
        """Room for n rays; nothing is written yet."""
        single = np.float32
        room = np.empty(n, single), np.empty((n, 3), single), np.empty(n, np.int32)
        return cls(*room, np.empty(n, single))

    def clear(self) -> None:
        """Make them rays that met nothing."""
        self.distance.fill(np.inf)
        self.normal.fill(0)
        self.index.fill(-1)
        self.lit.fill(1)

    def part(self, rows: slice) -> Hits:
        """Views of some rows."""
        return Hits(self.distance[rows], self.normal[rows], self.index[rows], self.lit[rows])


def trace(
    solids: Solids,
    position: Vector,
    rays: Array,
    near: Array,
    width: float,
    sun: Array,
    softness: float,
    into: Hits,
    *,
    beams: bool = False,
) -> None:
    """Follow rays (n, 3) on from `near` (n,) to at most `into.distance`; write what they meet.

    width is the angle between rays [rad], sun (3,) the direction of the light that throws shadows,
    or 0. With `beams` each ray stands for all that are within `width` of it: its distance becomes
    one up to which none of them meets anything, or stays if none does at all.
    """
    if solids.nearest is None:
        return
    sharpness = 1.0 / max(softness, 1e-4)
    setting = np.array([*position, width, sharpness, *sun], np.float32)
    hits = (into.distance, into.normal, into.index, into.lit)
    _tracer(solids.nearest)(solids.params, setting, rays, near, beams, *hits)


@jit(inline=True)
def _stride(d: Any, before: Any, step: Any) -> Any:
    """How far to go from a point at the distance d, when the step that led here began at `before`.

    On a flat face the largest step whose spheres still touch; 0.9 of what that is beyond d.
    """
    fall = before - d
    beyond = max(step - fall, _ZERO) / max(step + fall, _TENTH * step + _TINY)
    return d + (_NINE_TENTHS * d * beyond if step > _ZERO else _ZERO)


@cache
def _tracer(nearest: Callable[..., Any]) -> Any:
    """The tracing kernel of one distance function.

    It takes `LANES` rays at a time, and the loops over them, which have no branches, become SIMD.
    """

    @jit
    def measure(params: Any, lane: Any, which: Any) -> None:
        """Distance of the nearest solid from the point of each lane, and its index."""
        for a in range(LANES):
            x, y, z = lane[_AT + a], lane[_AT_Y + a], lane[_AT_Z + a]
            found, index = nearest(params, x, y, z)
            lane[_FOUND + a] = np.float32(found)
            which[a] = index

    @jit
    def trace_rays(
        params: Any,
        setting: Any,
        rays: Any,
        near: Any,
        beams: Any,
        distance: Any,
        normal: Any,
        index: Any,
        lit: Any,
    ) -> None:
        width, sharpness = setting[3], setting[4]
        # A beam reaches a surface where that is nearer than its own radius, and it goes in steps
        # that leave this much room.
        room = width if beams else _ZERO
        close = width if beams else _CLOSE * width
        flat = np.float32(0 if beams else 16) * width
        lane = np.empty(_ALL, np.float32)  # One array: its parts do not overlap.
        kind, which = np.empty(LANES, np.int32), np.empty(LANES, np.int32)
        count: Any = np.uint64(rays.shape[0])
        for group in range((count + LANES - _SINGLE) // LANES):
            first = group * LANES
            many = min(count - first, LANES)
            kind[:] = -1
            lane[_END : _END + LANES] = _ZERO
            for a in range(many):
                i = first + a
                lane[a], lane[_END + a] = near[i], min(distance[i], _FAR)
                lane[_STEP + a], lane[_BEFORE + a] = _ZERO, _ZERO
                for k in range(_AXES):
                    lane[_FROM + k * LANES + a] = setting[k]
                    lane[_ALONG + k * LANES + a] = rays[i, k]
            for _ in range(_STEPS):
                for a in range(LANES):
                    t = lane[a]
                    lane[_AT + a] = lane[_FROM + a] + t * lane[_ALONG + a]
                    lane[_AT_Y + a] = lane[_FROM_Y + a] + t * lane[_ALONG_Y + a]
                    lane[_AT_Z + a] = lane[_FROM_Z + a] + t * lane[_ALONG_Z + a]
                measure(params, lane, which)
                going = np.int32(0)
                for a in range(LANES):
                    t, end = lane[a], lane[_END + a]
                    d, before, step = lane[_FOUND + a], lane[_BEFORE + a], lane[_STEP + a]
                    # Where the spheres do not touch, take the cautious step after all.
                    apart = step > before + abs(d)
                    least = close * t
                    # A step too long may have led past the end.
                    on = (t < end) | (apart & (end > _ZERO))
                    met = on & (not apart) & (d - room * t < least)
                    forth = max((_stride(d, before, step) if not beams else d - room * t), least)
                    # The rest of the way, as the last step would have it of a flat face.
                    rest = min(d * step / max(before - d, _TINY), flat * t)
                    move = before - step if apart else rest if met else forth
                    lane[a] = t + (move if on else _ZERO)
                    lane[_STEP + a] = before if apart else forth
                    lane[_BEFORE + a] = before if apart else d
                    lane[_END + a] = end if on & (not met) else _ZERO
                    kind[a] = which[a] if met else kind[a]
                    going += np.int32(on & (not met))
                if going == 0:
                    break
            some = False
            for a in range(many):
                if kind[a] >= 0:
                    distance[first + a] = lane[a]
                    some = True
            if beams:
                continue
            if some:
                # Central differences on the corners of a tetrahedron.
                for a in range(LANES):
                    lane[_NORMAL + a] = _ZERO
                    lane[_NORMAL_Y + a] = _ZERO
                    lane[_NORMAL_Z + a] = _ZERO
                for corner in range(4):
                    ex = _ONE if corner == 0 or corner == 3 else -_ONE
                    ey = _ONE if corner >= 2 else -_ONE
                    ez = _ONE if corner & 1 else -_ONE
                    for a in range(LANES):
                        t = lane[a]
                        e = width * t
                        lane[_AT + a] = lane[_FROM + a] + t * lane[_ALONG + a] + e * ex
                        lane[_AT_Y + a] = lane[_FROM_Y + a] + t * lane[_ALONG_Y + a] + e * ey
                        lane[_AT_Z + a] = lane[_FROM_Z + a] + t * lane[_ALONG_Z + a] + e * ez
                    measure(params, lane, which)
                    for a in range(LANES):
                        lane[_NORMAL + a] += ex * lane[_FOUND + a]
                        lane[_NORMAL_Y + a] += ey * lane[_FOUND + a]
                        lane[_NORMAL_Z + a] += ez * lane[_FOUND + a]
                for a in range(many):
                    i = first + a
                    if kind[a] >= 0:
                        x, y, z = lane[_NORMAL + a], lane[_NORMAL_Y + a], lane[_NORMAL_Z + a]
                        scale = _ONE / np.float32(np.sqrt(x * x + y * y + z * z + _TINY))
                        normal[i, 0], normal[i, 1], normal[i, 2] = x * scale, y * scale, z * scale
                        index[i] = kind[a]
            # From what they met towards the sun; the rows of `end` now keep the light.
            going = np.int32(0)
            lane[:LANES] = _NOTHING
            for a in range(many):
                i = first + a
                facing = _ZERO
                for k in range(_AXES):
                    facing += normal[i, k] * setting[np.uint64(5) + k]
                t = distance[i]
                e = width * t
                lane[_LIGHT + a] = _ONE if facing > _ZERO else _ZERO
                open_way = facing > _ZERO and t < _FAR
                lane[a] = np.float32(2) * e if open_way else _NOTHING
                lane[_STEP + a], lane[_BEFORE + a] = _ZERO, _ZERO
                going += np.int32(open_way)
                for k in range(_AXES):
                    way = t * rays[i, k] + e * normal[i, k] if open_way else _ZERO
                    lane[_FROM + k * LANES + a] = setting[k] + way
            for _ in range(_SHADOW_STEPS):
                if going == 0:
                    break
                for a in range(LANES):
                    along = lane[a] if lane[a] < _NOTHING else _ZERO
                    lane[_AT + a] = lane[_FROM + a] + along * setting[5]
                    lane[_AT_Y + a] = lane[_FROM_Y + a] + along * setting[6]
                    lane[_AT_Z + a] = lane[_FROM_Z + a] + along * setting[7]
                measure(params, lane, which)
                going = np.int32(0)
                for a in range(LANES):
                    t, light = lane[a], lane[_LIGHT + a]
                    d, before, step = lane[_FOUND + a], lane[_BEFORE + a], lane[_STEP + a]
                    apart = step > before + abs(d)
                    on = (light > _ZERO) & ((t < _SHADOW_FAR) | (apart & (t < _NOTHING)))
                    seen = min(light, sharpness * d / t)
                    seen = _ZERO if seen < _DARK else seen
                    lane[_LIGHT + a] = seen if on & (not apart) else light
                    forth = max(_stride(d, before, step), _CLOSE * width * t)
                    lane[a] = t + (before - step if apart else forth) if on else _NOTHING
                    lane[_STEP + a] = before if apart else forth
                    lane[_BEFORE + a] = before if apart else d
                    going += np.int32(on)
            for a in range(many):
                light = lane[_LIGHT + a]
                lit[first + a] = light * light * (np.float32(3) - np.float32(2) * light)

    return trace_rays
