"""Particles to an image: project all layers, distribute them to tiles, sort and composite each.

A tile belongs to one thread and its list to the order of the particles, so the picture has the
same bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, share
from motes.renderer.camera import Camera, Vector
from motes.renderer.composite import composite
from motes.renderer.lamps import scattered
from motes.renderer.layer import Layer
from motes.renderer.order import sort_tiles
from motes.renderer.project import TILE, distribute, project

Array = NDArray[np.float32]

ROWS = 16384
"""Particles per task of projection."""

WORK = 100_000
"""Records per task of compositing: some tens of milliseconds."""

PACKED_BYTES = 1 << 29
"""Most memory for packed records; beyond it a frame is drawn in slabs of depth, front first."""


@dataclass(frozen=True, eq=False)
class Depths:
    """How far the solids are along the camera's axis [m]."""

    depth: Array
    """(h, w), infinite where there is none; (0, 0) where there are no solids at all."""

    edge: NDArray[np.int32]
    """(h, w) row of `samples` for a pixel on a silhouette, else -1."""

    samples: Array
    """(e, 4) depths within such a pixel."""

    @cached_property
    def bounds(self) -> Array:
        """(tiles, 2) least and greatest depth in each tile; (0, 2) where there are no solids."""
        if not self.depth.size:
            return np.empty((0, 2), np.float32)
        row, column = np.nonzero(self.edge >= 0)
        within = self.samples[self.edge[row, column]]
        starts = [np.arange(0, size, TILE) for size in self.depth.shape]
        bounds = []
        for extreme in (np.minimum, np.maximum):
            depth = self.depth.copy()
            depth[row, column] = extreme.reduce(within, axis=1)
            rows = extreme.reduceat(depth, starts[0], axis=0)
            bounds.append(extreme.reduceat(rows, starts[1], axis=1).ravel())
        return np.stack(bounds, axis=1)


NO_LAMPS = np.empty((0, 7), np.float32)
NO_LIGHT = np.empty((0, 3), np.float32)

NO_SOLIDS = Depths(
    np.empty((0, 0), np.float32), np.empty((0, 0), np.int32), np.empty((0, 4), np.float32)
)


def splat(
    layers: Sequence[Layer],
    camera: Camera,
    backdrop: Array,
    *,
    shutter: float = 0.0,
    light: Vector = (1.0, 1.0, 1.0),
    lamps: Array = NO_LAMPS,
    depths: Depths = NO_SOLIDS,
) -> Array:
    """Draw layers over a backdrop (h, w, 4), premultiplied; returns (h, w, 4) of the same kind.

    shutter [s] is how long streaks are; light is what matter scatters per color, and lamps (k, 7)
    add to it.
    """
    height, width = backdrop.shape[:2]
    across, down = -(-width // TILE), -(-height // TILE)
    records = _project(layers, camera, (width, height), shutter, light, lamps)
    covers = any(layer.opacity > 0 for layer in layers)
    image = np.empty((height, width, 4), np.float32)
    shown = image.reshape(height, 4 * width)
    under = np.ascontiguousarray(backdrop).reshape(height, 4 * width)
    slabs = _slabs(records, across, down)
    for number, slab in enumerate(slabs):
        starts, packed = _pack(slab, across, down)
        order = np.empty(len(packed) if covers else 0, np.uint32)
        cuts = _cuts(starts, across)

        def task(
            band: int,
            cuts: NDArray[np.int64] = cuts,
            starts: NDArray[np.int64] = starts,
            packed: Array = packed,
            order: NDArray[np.uint32] = order,
            fresh: bool = number == 0,
            final: bool = number == len(slabs) - 1,
        ) -> None:
            low, high = cuts[band], cuts[band + 1]
            if covers:
                sort_tiles(low, high, starts, packed, order)
            tiles = (low, high, across, starts, order, packed)
            solids = (depths.depth, depths.edge, depths.samples, depths.bounds)
            composite(*tiles, *solids, under, fresh, final, shown)

        share(task, len(cuts) - 1)
    return image


def _project(
    layers: Sequence[Layer],
    camera: Camera,
    size: tuple[int, int],
    shutter: float,
    light: Vector,
    lamps: Array,
) -> Array:
    """One record per particle of all layers, (n, 8) or (n, 12)."""
    plain = all(layer.kind != "streaks" and layer.softness <= 0 for layer in layers)
    records = np.empty((sum(map(len, layers)), 8 if plain else 12), np.float32)
    views = np.stack([camera.view(), (camera.close or camera).view()])
    offset = 0
    for layer in layers:
        layer, open_for = _with_trail(layer, shutter)
        rows = records[offset : offset + len(layer)]
        offset += len(layer)
        moving = layer.kind == "streaks"
        lamplit = len(lamps) > 0 and layer.opacity > 0
        lit = scattered(layer.position, lamps) if lamplit else NO_LIGHT
        lens = np.array(
            [
                camera.focal(size[1]),
                *size,
                camera.near,
                open_for,
                1.0 / max(layer.softness, 1e-20),
                layer.opacity,
                *(layer.emission + layer.opacity * channel for channel in light),
            ],
            np.float32,
        )
        tasks = blocks(len(layer), ROWS)

        def task(
            number: int,
            tasks: list[tuple[int, int]] = tasks,
            layer: Layer = layer,
            lens: Array = lens,
            rows: Array = rows,
            lit: Array = lit,
            moving: bool = moving,
        ) -> None:
            part = slice(*tasks[number])
            clip = np.empty((0, 2), np.float32) if layer.shutter is None else layer.shutter[part]
            columns = (layer.position[part], layer.velocity[part], layer.color[part])
            project(*columns, layer.size[part], lit[part], clip, views, lens, moving, rows[part])

        share(task, len(tasks))
    return records


def _with_trail(layer: Layer, shutter: float) -> tuple[Layer, float]:
    """The layer as it is drawn by a shutter that opens with its trail, and how long that is."""
    trail = layer.trail
    if layer.kind != "streaks" or not trail > 0:
        return layer, shutter
    whole = trail + shutter
    clip = np.tile(np.array([0, 1], np.float32), (len(layer), 1))
    if layer.shutter is not None:
        clip[:, 1] = (trail + shutter * layer.shutter[:, 1]) / whole
    if layer.age is not None:
        clip[:, 0] = np.maximum(trail - layer.age, 0) / whole
    position = layer.position - np.float32(trail) * layer.velocity
    return replace(layer, position=position, shutter=clip, trail=0.0), whole


def _pack(records: Array, across: int, down: int) -> tuple[NDArray[np.int64], Array]:
    """Records tile by tile, each tile's in the order of the particles, and where tiles start."""
    tasks = blocks(len(records), ROWS)
    counts = np.zeros((len(tasks), across * down), np.int64)
    none = np.empty((0, records.shape[1]), np.float32)

    def count(number: int) -> None:
        distribute(records[slice(*tasks[number])], counts[number], across, down, none)

    share(count, len(tasks))
    ends = np.cumsum(counts.T.ravel()).reshape(across * down, len(tasks))
    places = np.ascontiguousarray(ends.T) - counts
    starts = np.append(0, ends[:, -1]) if len(tasks) else np.zeros(across * down + 1, np.int64)
    packed = np.empty((int(starts[-1]), records.shape[1]), np.float32)
    pages = blocks(len(packed), ROWS)
    # In order, the system hands out its pages at a tenth of the cost.
    share(lambda number: packed[slice(*pages[number])].fill(0), len(pages))

    def fill(number: int) -> None:
        distribute(records[slice(*tasks[number])], places[number], across, down, packed)

    share(fill, len(tasks))
    return starts, packed


def _slabs(records: Array, across: int, down: int) -> list[Array]:
    """The records in one piece, or slabs of depth where their copies would exceed memory."""
    most = PACKED_BYTES // (4 * records.shape[1])
    extent = 2 * records[:, 2:3]
    if records.shape[1] > 8:
        extent = extent + np.abs(records[:, 8:10])
    widest = np.minimum(extent.max(initial=0.0) / TILE + 2, (across, down)).astype(np.float64)
    if len(records) * widest.prod() <= most:
        return [records]
    visible = np.flatnonzero(records[:, 2] > 0)
    depth = -records[visible, 3]
    if records.shape[1] > 8:
        depth -= records[visible, 10] / 2
    order = visible[np.argsort(depth, kind="stable")]
    tiles = np.minimum(extent[order] / TILE + 2, (across, down)).astype(np.float64)
    slab = np.cumsum(np.maximum(tiles[:, 0] * tiles[:, -1], 0)) // max(most - across * down, 1)
    return np.split(records[order], np.flatnonzero(np.diff(slab)) + 1)


def _cuts(starts: NDArray[np.int64], across: int) -> NDArray[np.int64]:
    """Bounds of runs of tiles: at most a row of them, and `WORK` records where one has not more."""
    tiles = len(starts) - 1
    group = starts[:-1] // WORK + np.arange(tiles) // across * (starts[-1] // WORK + 1)
    return np.concatenate([[0], np.flatnonzero(np.diff(group)) + 1, [tiles]])
