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
_SHADOW_FAR = np.float32(50)
_STEPS = 160
_SHADOW_STEPS = 40


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

    def meet_planes(self, position: Vector, rays: Array, near: Array, into: Hits) -> None:
        """Write where rays (n, 3) meet planes beyond `near` and before `into.distance`."""
        for index, (x, y, z, offset) in enumerate(self.planes, self.bent):
            normal = np.array([x, y, z])
            height = np.float32(normal @ np.asarray(position) - offset)
            with np.errstate(all="ignore"):
                distance = -height / (rays @ normal)
            met = (height > 0) & (distance > near) & (distance < into.distance)
            into.distance[met] = distance[met]
            into.normal[met] = normal
            into.index[met] = index


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
    def none(cls, n: int) -> Hits:
        """Rays that met nothing."""
        return cls(
            np.full(n, np.inf, np.float32),
            np.zeros((n, 3), np.float32),
            np.full(n, -1, np.int32),
            np.ones(n, np.float32),
        )

    def part(self, rows: slice | NDArray[np.intp]) -> Hits:
        """Some rows; a slice gives views."""
        return Hits(self.distance[rows], self.normal[rows], self.index[rows], self.lit[rows])

    def followed_by(self, other: Hits) -> Hits:
        """These rays, then others."""
        names = ("distance", "normal", "index", "lit")
        return Hits(*(np.concatenate([getattr(self, k), getattr(other, k)]) for k in names))


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


@cache
def _tracer(nearest: Callable[..., Any]) -> Any:
    """The tracing kernel of one distance function."""

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
        for i in range(rays.shape[0]):
            t, end = near[i], min(distance[i], _FAR)
            x, y, z = setting[0], setting[1], setting[2]
            dx, dy, dz = rays[i, 0], rays[i, 1], rays[i, 2]
            # Two ways, one after the other: from the eye, then from what it met to the sun.
            step, before, light = _ZERO, _ZERO, _ONE
            shadow, arrived = False, not t < end
            tries = 0
            while tries < _STEPS:
                if arrived:
                    t = distance[i]
                    nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
                    if not nx * setting[5] + ny * setting[6] + nz * setting[7] > _ZERO:
                        light = _ZERO
                    if beams or light == _ZERO or t > _FAR:
                        break
                    e = width * t
                    x, y, z = x + t * dx + e * nx, y + t * dy + e * ny, z + t * dz + e * nz
                    dx, dy, dz = setting[5], setting[6], setting[7]
                    t, step, before, tries = np.float32(2) * e, _ZERO, _ZERO, _STEPS - _SHADOW_STEPS
                    shadow, arrived = True, False
                tries += 1
                found, which = nearest(params, x + t * dx, y + t * dy, z + t * dz)
                d = np.float32(found)
                if step > before + abs(d):
                    # The spheres do not touch: take the cautious step after all.
                    t += before - step
                    step = before
                    continue
                forth = d
                if shadow:
                    light = min(light, sharpness * d / t)
                    if t > _SHADOW_FAR:
                        break
                    if light < _DARK:
                        light = _ZERO
                        break
                elif t > end:
                    arrived = True
                    continue
                elif beams:
                    forth -= width * t
                    if forth < width * t:
                        distance[i] = t
                        break
                elif d < _CLOSE * width * t:
                    # The rest of the way, as the last step would have it of a flat face.
                    t += min(d * step / max(before - d, _TINY), np.float32(16) * width * t)
                    distance[i] = t
                    index[i] = which
                    px, py, pz = x + t * dx, y + t * dy, z + t * dz
                    # Central differences on the corners of a tetrahedron.
                    e = width * t
                    a, _ = nearest(params, px + e, py - e, pz - e)
                    b, _ = nearest(params, px - e, py - e, pz + e)
                    c, _ = nearest(params, px - e, py + e, pz - e)
                    f, _ = nearest(params, px + e, py + e, pz + e)
                    nx = np.float32(a - b - c + f)
                    ny = np.float32(c - a - b + f)
                    nz = np.float32(b - a - c + f)
                    scale = _ONE / np.float32(np.sqrt(nx * nx + ny * ny + nz * nz + _TINY))
                    normal[i, 0], normal[i, 1], normal[i, 2] = nx * scale, ny * scale, nz * scale
                    arrived = True
                    continue
                elif step > _ZERO:
                    fall = before - d
                    forth += np.float32(0.9) * d * max(step - fall, _ZERO) / (step + fall)
                before, step = d, max(forth, _CLOSE * width * t)
                t += step
            smooth = min(max(light, _ZERO), _ONE)
            lit[i] = smooth * smooth * (np.float32(3) - np.float32(2) * smooth)

    return trace_rays
