"""Sky and solids as one image with depths: what particles are drawn over and hidden by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, share
from motes.renderer.camera import Camera
from motes.renderer.lamps import illuminate
from motes.renderer.sky import Sky, Sun, shade
from motes.renderer.solids import Hits, Solids, trace
from motes.renderer.splat import NO_SOLIDS, Depths

Array = NDArray[np.float32]

RAYS = 1 << 15
"""Rays per task: some milliseconds."""

BLOCK = 8
"""Width of the blocks of pixels whose rays share the first part of their way."""

_HALF = np.float32(0.5)
_QUARTER = np.float32(0.25)
_ZERO = np.float32(0)
_UP = np.array([0.0, 0.0, 1.0], np.float32)

# Four sub-samples of a pixel on a rotated grid: each row and column of a 4 x 4 grid once.
_SUB_X = np.array([0.375, 0.875, 0.625, 0.125])
_SUB_Y = np.array([0.125, 0.375, 0.875, 0.625])


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What is behind the particles, and how far."""

    image: Array
    """(h, w, 4) premultiplied linear light."""

    depths: Depths
    """Of the solids, along the axis of the camera."""

    surface: Surface | None = None
    """What lamps may light; None where there are no solids."""

    def lit(self, lamps: Array) -> Array:
        """The image with the light of lamps (k, 7) on the solids."""
        if self.surface is None or not len(lamps):
            return self.image
        image = self.image.copy()
        s = self.surface
        illuminate(s.position, s.normal, s.color, s.pixel, lamps, image.reshape(-1, 4))
        return image


@dataclass(frozen=True, eq=False)
class Surface:
    """Points of solids that are seen: 4 in succession for each pixel of a silhouette, then one."""

    position: Array
    """(n, 3) [m]."""

    normal: Array
    """(n, 3) outward unit normal; 0 where nothing was met."""

    color: Array
    """(n, 3) what a light of 1 on the point adds to its pixel, through the haze."""

    pixel: NDArray[np.int32]
    """(n,) row times width plus column."""


def backdrop(
    camera: Camera, size: tuple[int, int], sky: Sky | None, solids: Solids | None
) -> Backdrop:
    """Draw the sky, or nothing where `sky` is None, and before it the solids.

    Pixels on silhouettes and creases are the mean of 4 sub-samples.

    Raises:
        ValueError: the solids name an index without a colour.
    """
    width, height = size
    if sky is None and solids is None:
        return Backdrop(np.zeros((height, width, 4), np.float32), NO_SOLIDS)
    y, x = np.divmod(np.arange(width * height, dtype=np.int32), width)
    rays = camera.rays(x + _HALF, y + _HALF, size)
    near = np.full(len(rays), camera.near, np.float32)
    clear = near if solids is None else _clear_way(camera, size, solids)
    hits, color = _look(camera, rays, near, clear, height, sky, solids)
    image = color.reshape(height, width, 4)
    if solids is None:
        return Backdrop(image, NO_SOLIDS)
    row, column = np.nonzero(_edges(hits, size, solids.bent))
    sub_x = (column[:, None] + _SUB_X).ravel()
    sub_y = (row[:, None] + _SUB_Y).ravel()
    sub_rays = camera.rays(sub_x, sub_y, size)
    near = np.full(len(sub_rays), camera.near, np.float32)
    sub_hits, sub_color = _look(camera, sub_rays, near, near, height, sky, solids)
    image[row, column] = sub_color.reshape(-1, 4, 4).mean(axis=1)
    edge = np.full((height, width), -1, np.int32)
    edge[row, column] = np.arange(len(row))
    forward = camera.axes()[2].astype(np.float32)
    depth = (hits.distance * (rays @ forward)).reshape(height, width)
    samples = (sub_hits.distance * (sub_rays @ forward)).reshape(-1, 4)
    whole = np.flatnonzero((edge.ravel() < 0) & (hits.index >= 0))
    pixels = np.append(np.repeat(row * width + column, 4), whole).astype(np.int32)
    seen = sub_hits.followed_by(hits.part(whole))
    ways = np.concatenate([sub_rays, rays[whole]])
    surface = _surface(camera, ways, seen, pixels, len(sub_rays), sky or Sky(), solids.colors)
    return Backdrop(image, Depths(depth, edge, samples), surface)


def _surface(
    camera: Camera,
    rays: Array,
    hits: Hits,
    pixels: NDArray[np.int32],
    quarters: int,
    sky: Sky,
    colors: Array,
) -> Surface:
    """The points that rays (n, 3) met; the first `quarters` of them are a quarter of a pixel."""
    distance: Array = np.where(hits.index >= 0, hits.distance, _ZERO)[:, None]
    seen = np.exp(distance / np.float32(-sky.haze))
    seen[:quarters] *= _QUARTER
    seen[hits.index < 0] = 0
    position = np.asarray(camera.position, np.float32) + distance * rays
    return Surface(position, hits.normal, seen * colors[hits.index], pixels)


def _clear_way(camera: Camera, size: tuple[int, int], solids: Solids) -> Array:
    """Distance up to which no bent solid is near a pixel's ray, (h w,), found for blocks."""
    width, height = size
    across, down = -(-width // BLOCK), -(-height // BLOCK)
    y, x = np.divmod(np.arange(across * down, dtype=np.int32), across)
    rays = camera.rays((x + _HALF) * BLOCK, (y + _HALF) * BLOCK, size)
    hits = Hits.none(len(rays))
    near = np.full(len(rays), camera.near, np.float32)
    tasks = blocks(len(rays), RAYS // BLOCK)
    reach = BLOCK * 0.7072 / camera.focal(height)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        ways = (camera.position, rays[rows], near[rows])
        trace(solids, *ways, reach, _UP, 0.0, hits.part(rows), beams=True)

    share(task, len(tasks))
    square = hits.distance.reshape(down, across).repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
    return square[:height, :width].ravel()


def _look(
    camera: Camera,
    rays: Array,
    near: Array,
    clear: Array,
    height: int,
    sky: Sky | None,
    solids: Solids | None,
) -> tuple[Hits, Array]:
    """What rays (n, 3) meet beyond `near`, and their light and coverage (n, 4).

    Bent solids are looked for beyond `clear` only.
    """
    hits = Hits.none(len(rays))
    color = np.ones((len(rays), 4), np.float32)
    lamp = sky or Sky()
    numbers = lamp.numbers()
    softness = (lamp.sun or Sun()).softness
    tasks = blocks(len(rays), RAYS)
    colors = np.zeros((1, 3), np.float32) if solids is None else solids.colors
    width = 1.0 / camera.focal(height)
    sun = numbers[4]
    if lamp.sun is None or (solids is not None and solids.hide(sun)):
        sun = np.zeros(3, np.float32)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        some = hits.part(rows)
        if solids is not None:
            solids.meet_planes(camera.position, rays[rows], near[rows], some)
            ways = (camera.position, rays[rows], clear[rows])
            trace(solids, *ways, width, sun, softness, some)
            if some.index.max(initial=-1) >= len(colors):
                raise ValueError(f"solid {some.index.max()} has no colour; there are {len(colors)}")
        surface = (some.distance, some.normal, some.index, some.lit)
        shade(rays[rows], *surface, colors, numbers, color[rows])

    share(task, len(tasks))
    if sky is None:
        color[np.isinf(hits.distance)] = 0.0
    return hits, color


def _edges(hits: Hits, size: tuple[int, int], bent: int) -> NDArray[np.bool_]:
    """Pixels with a neighbour that shows another solid, another face, or is much farther.

    Indices from `bent` on are those of planes, which have a single face.
    """
    width, height = size
    index = hits.index.reshape(height, width)
    near = 1.0 / hits.distance.reshape(height, width)
    normal = hits.normal.reshape(height, width, 3)
    edges = np.zeros((height, width), np.bool_)
    for first, second in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ):
        differs = index[first] != index[second]
        differs |= np.einsum("...k,...k", normal[first], normal[second]) < 0.8
        differs &= np.maximum(index[first], index[second]) >= 0
        # On a flat face 1/distance changes evenly, so only a jump counts.
        jump = np.abs(near[first] - near[second]) > 0.1 * np.maximum(near[first], near[second])
        differs |= jump & (index[first] < bent)
        edges[first] |= differs
        edges[second] |= differs
    return edges
