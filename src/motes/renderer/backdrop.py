"""Sky and solids as one image with depths: what particles are drawn over and hidden by."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, share
from motes.renderer.camera import Camera
from motes.renderer.lamps import illuminate
from motes.renderer.sky import Sky, Sun, shade
from motes.renderer.solids import Hits, Solids, trace
from motes.renderer.splat import NO_SOLIDS, Depths

Array = NDArray[np.float32]

RAYS = 1 << 14
"""Rays per task: some milliseconds, and little enough to stay in the processor's cache."""

BLOCK = 8
"""Width of the blocks of pixels whose rays share the first part of their way."""

_HALF = np.float32(0.5)
_UP = np.array([0.0, 0.0, 1.0], np.float32)

# Four sub-samples of a pixel on a rotated grid: each row and column of a 4 x 4 grid once.
_SUB_X = np.array([0.375, 0.875, 0.625, 0.125], np.float32)
_SUB_Y = np.array([0.125, 0.375, 0.875, 0.625], np.float32)


@dataclass(frozen=True, eq=False)
class View:
    """What a camera shows at points x, y of a picture [pixels]."""

    camera: Camera
    size: tuple[int, int]
    x: Array
    y: Array
    hits: Hits
    depth: Array
    """(n,) distance along the camera's axis [m]."""
    color: Array
    """(n, 4) premultiplied linear light."""

    def add_light(self, lamps: Array, colors: Array, haze: float, out: Array) -> None:
        """Add the light of lamps (k, 7) on solids of `colors`, through the haze, to out (n, 4)."""
        tasks = blocks(len(self.x), RAYS)

        def task(number: int) -> None:
            rows = slice(*tasks[number])
            hits = self.hits.part(rows)
            rays = self.camera.rays(self.x[rows], self.y[rows], self.size)
            surface = (hits.distance, hits.normal, hits.index)
            illuminate(self.camera.position, rays, *surface, colors, haze, lamps, out[rows])

        share(task, len(tasks))


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What is behind the particles, and how far."""

    image: Array
    """(h, w, 4) premultiplied linear light."""

    depths: Depths
    """Of the solids, along the axis of the camera."""

    views: tuple[View, View] | None = None
    """Of all pixels, and of 4 points in succession in each of the `edges`; None without solids."""

    edges: tuple[NDArray[np.intp], NDArray[np.intp]] | None = None
    """Row and column of the pixels on silhouettes and creases."""

    def lit(self, lamps: Array, colors: Array, haze: float) -> Array:
        """The image with the light of lamps (k, 7) on the solids, which have `colors`."""
        if self.views is None or not len(lamps):
            return self.image
        image = self.image.copy()
        whole, parts = self.views
        whole.add_light(lamps, colors, haze, image.reshape(-1, 4))
        light = parts.color.copy()
        parts.add_light(lamps, colors, haze, light)
        image[self.edges] = light.reshape(-1, 4, 4).mean(axis=1)
        return image


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
    x, y = _centers(width, height, 1)
    if solids is None:
        whole = _look(camera, size, x, y, np.broadcast_to(np.float32(0), len(x)), sky, None)
        return Backdrop(whole.color.reshape(height, width, 4), NO_SOLIDS)
    whole = _look(camera, size, x, y, _clear_way(camera, size, solids), sky, solids)
    row, column = np.nonzero(_edges(whole.hits, size, solids.bent))
    x, y = (column[:, None] + _SUB_X).ravel(), (row[:, None] + _SUB_Y).ravel()
    clear = np.full(len(x), camera.near, np.float32)
    parts = _look(camera, size, x.astype(np.float32), y.astype(np.float32), clear, sky, solids)
    image = whole.color.reshape(height, width, 4)
    image[row, column] = parts.color.reshape(-1, 4, 4).mean(axis=1)
    edge = np.full((height, width), -1, np.int32)
    edge[row, column] = np.arange(len(row))
    depths = Depths(whole.depth.reshape(height, width), edge, parts.depth.reshape(-1, 4))
    return Backdrop(image, depths, (whole, parts), (row, column))


@lru_cache(maxsize=4)
def _centers(width: int, height: int, step: int) -> tuple[Array, Array]:
    """Middles of squares of `step` pixels, row by row [pixels]."""
    y, x = np.divmod(np.arange(width * height, dtype=np.int32), width)
    return (x + _HALF) * np.float32(step), (y + _HALF) * np.float32(step)


def _clear_way(camera: Camera, size: tuple[int, int], solids: Solids) -> Array:
    """Distance up to which no bent solid is near a pixel's ray, (h w,), found for blocks."""
    width, height = size
    across, down = -(-width // BLOCK), -(-height // BLOCK)
    x, y = _centers(across, down, BLOCK)
    hits = Hits.empty(len(x))
    hits.clear()
    near = np.full(len(x), camera.near, np.float32)
    tasks = blocks(len(x), RAYS // BLOCK)
    reach = BLOCK * 0.7072 / camera.focal(height)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        ways = (camera.position, camera.rays(x[rows], y[rows], size), near[rows])
        trace(solids, *ways, reach, _UP, 0.0, hits.part(rows), beams=True)

    share(task, len(tasks))
    square = hits.distance.reshape(down, across).repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
    return square[:height, :width].ravel()


def _look(
    camera: Camera,
    size: tuple[int, int],
    x: Array,
    y: Array,
    clear: Array,
    sky: Sky | None,
    solids: Solids | None,
) -> View:
    """What is seen at points x, y of a picture; bent solids are looked for beyond `clear` only."""
    n = len(x)
    hits = Hits.empty(n)
    depth = np.empty(n, np.float32)
    color = np.empty((n, 4), np.float32)
    lamp = sky or Sky()
    numbers = lamp.numbers()
    softness = (lamp.sun or Sun()).softness
    tasks = blocks(n, RAYS)
    colors = np.zeros((1, 3), np.float32) if solids is None else solids.colors
    width = 1.0 / camera.focal(size[1])
    forward = camera.axes()[2].astype(np.float32)
    sun = numbers[4]
    if lamp.sun is None or (solids is not None and solids.hide(sun)):
        sun = np.zeros(3, np.float32)

    def task(number: int) -> None:
        rows = slice(*tasks[number])
        some = hits.part(rows)
        some.clear()
        rays = camera.rays(x[rows], y[rows], size)
        if solids is not None:
            solids.meet_planes(camera.position, rays, camera.near, some)
            trace(solids, camera.position, rays, clear[rows], width, sun, softness, some)
            if some.index.max(initial=-1) >= len(colors):
                raise ValueError(f"solid {some.index.max()} has no colour; there are {len(colors)}")
        depth[rows] = some.distance * (rays @ forward)
        surface = (some.distance, some.normal, some.index, some.lit)
        shade(rays, *surface, colors, numbers, color[rows])
        if sky is None:
            color[rows][some.index < 0] = 0.0

    share(task, len(tasks))
    return View(camera, size, x, y, hits, depth, color)


def _edges(hits: Hits, size: tuple[int, int], bent: int) -> NDArray[np.bool_]:
    """Pixels with a neighbour that shows another solid, another face, or is much farther.

    Indices from `bent` on are those of planes, which have a single face.
    """
    width, height = size
    index = hits.index.reshape(height, width)
    edges = np.zeros((height, width), np.bool_)
    for first, second, apart in (
        (np.s_[:, :-1], np.s_[:, 1:], 1),
        (np.s_[:-1], np.s_[1:], width),
    ):
        differs = index[first] != index[second]
        row, column = np.nonzero((index[first] >= 0) & (index[first] < bent) & ~differs)
        one = row * width + column
        other = one + apart
        # On a flat face 1/distance changes evenly, so only a jump counts.
        near, next_near = 1.0 / hits.distance[one], 1.0 / hits.distance[other]
        differs[row, column] = np.abs(near - next_near) > 0.1 * np.maximum(near, next_near)
        folded = np.einsum("ik,ik->i", hits.normal[one], hits.normal[other]) < 0.8
        differs[row, column] |= folded
        edges[first] |= differs
        edges[second] |= differs
    return edges
