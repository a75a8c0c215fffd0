"""Sky and solids as one image with depths: what particles are drawn over and hidden by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, share
from motes.render.camera import Camera
from motes.render.sky import Sky, Sun, shade
from motes.render.solids import Hits, Solids, trace
from motes.render.splat import NO_SOLIDS, Depths

Array = NDArray[np.float32]

RAYS = 1 << 15
"""Rays per task: some milliseconds."""

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
    y, x = np.divmod(np.arange(width * height), width)
    rays = camera.rays(x + 0.5, y + 0.5, size)
    hits, color = _look(camera, rays, height, sky, solids)
    image = color.reshape(height, width, 4)
    if solids is None:
        return Backdrop(image, NO_SOLIDS)
    row, column = np.nonzero(_edges(hits, size))
    sub_x = (column[:, None] + _SUB_X).ravel()
    sub_y = (row[:, None] + _SUB_Y).ravel()
    sub_rays = camera.rays(sub_x, sub_y, size)
    sub_hits, sub_color = _look(camera, sub_rays, height, sky, solids)
    image[row, column] = sub_color.reshape(-1, 4, 4).mean(axis=1)
    edge = np.full((height, width), -1, np.int32)
    edge[row, column] = np.arange(len(row))
    forward = camera.axes()[2].astype(np.float32)
    depth = (hits.distance * (rays @ forward)).reshape(height, width)
    samples = (sub_hits.distance * (sub_rays @ forward)).reshape(-1, 4)
    return Backdrop(image, Depths(depth, edge, samples))


def _look(
    camera: Camera, rays: Array, height: int, sky: Sky | None, solids: Solids | None
) -> tuple[Hits, Array]:
    """What rays (n, 3) meet, and their light and coverage (n, 4)."""
    hits = Hits.none(len(rays))
    color = np.ones((len(rays), 4), np.float32)
    lamp = sky or Sky()
    numbers = lamp.numbers()
    softness = (lamp.sun or Sun()).softness
    tasks = blocks(len(rays), RAYS)
    colors = np.zeros((1, 3), np.float32) if solids is None else solids.colors

    def task(number: int) -> None:
        part = slice(*tasks[number])
        some = Hits(hits.distance[part], hits.normal[part], hits.index[part], hits.lit[part])
        if solids is not None:
            pixel = 1.0 / camera.focal(height)
            trace(solids, camera, rays[part], numbers[4], softness, pixel, some)
            if some.index.max(initial=-1) >= len(colors):
                raise ValueError(f"solid {some.index.max()} has no colour; there are {len(colors)}")
        surface = (some.distance, some.normal, some.index, some.lit)
        shade(rays[part], *surface, colors, numbers, color[part])

    share(task, len(tasks))
    if sky is None:
        color[np.isinf(hits.distance)] = 0.0
    return hits, color


def _edges(hits: Hits, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Pixels with a neighbour that shows another solid, another face, or is much farther."""
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
        differs |= jump
        edges[first] |= differs
        edges[second] |= differs
    return edges
