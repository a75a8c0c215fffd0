"""The glow of a lens: a part k of the light is spread by a sum of ever wider kernels.

I' = (1 - k) I + k mean over octaves of U..U D..D I, where D halves the size by the binomial weights
(1, 3, 3, 1)/8 in x and y and U doubles it by the same weights. Both keep the sum of the light. Past
the border the picture goes on as it is there, so that the glow leaves an even picture even.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share
from motes.renderer.film import Film

Array = NDArray[np.float32]

ROWS = 16
"""Rows of pixels per task."""

_ZERO = np.float32(0)


def bloom(image: Array, film: Film) -> None:
    """Spread the colour of image (h, w, 4) in place; alpha stays."""
    octaves = min(film.bloom_radius, int(np.log2(max(min(image.shape[:2]) // 4, 1))))
    if film.bloom <= 0 or octaves < 1:
        return
    pyramid = [image]
    for _ in range(octaves):
        height, width = pyramid[-1].shape[:2]
        smaller = np.zeros((-(-height // 2), -(-width // 2), 4), np.float32)
        _resample(pyramid[-1], smaller, 2, 0.0, 1.0)
        pyramid.append(smaller)
    # From the widest to the finest: each holds the mean of itself and all that are wider.
    for octave in range(octaves, 1, -1):
        wider = np.float32((octaves - octave + 1) / (octaves - octave + 2))
        _resample(pyramid[octave], pyramid[octave - 1], 1, float(1 - wider), float(wider))
    _resample(pyramid[1], image, 1, 1 - film.bloom, film.bloom)


def _resample(source: Array, target: Array, factor: int, keep: float, gain: float) -> None:
    """target = keep target + gain (source halved for factor 2, doubled for factor 1)."""
    tasks = blocks(len(target), ROWS)
    keep_gain = np.array([keep, gain], np.float32)
    columns = _taps(target.shape[1], source.shape[1], factor)
    rows = _taps(target.shape[0], source.shape[0], factor)

    def task(number: int) -> None:
        part = slice(*tasks[number])
        _gather(source, rows[0][part], rows[1][part], *columns, keep_gain, target[part])

    share(task, len(tasks))


def _taps(count: int, size: int, factor: int) -> tuple[NDArray[np.int32], Array]:
    """Source index within `size` and weight of each target pixel of an axis, (count, 2 factor)."""
    target = np.arange(count)[:, None]
    if factor == 2:
        index = 2 * target + np.arange(-1, 3)
        weight = np.broadcast_to(np.array([1, 3, 3, 1]) / 8, index.shape)
    else:
        index = (target + np.array([-1, 1])) // 2
        weight = np.where(target % 2 == [0, 1], 0.25, 0.75)
    return np.clip(index, 0, size - 1).astype(np.int32), np.array(weight, np.float32, order="C")


@jit
def _gather(
    source: Any, rows: Any, row_weight: Any, columns: Any, column_weight: Any, mix: Any, target: Any
) -> None:
    """Separable weighted sum of source pixels, mixed into the target."""
    width = source.shape[1]
    line = np.empty((width, 4), np.float32)
    for y in range(target.shape[0]):
        line[:] = _ZERO
        for j in range(rows.shape[1]):
            row, w = rows[y, j], row_weight[y, j]
            for x in range(width):
                for k in range(4):
                    line[x, k] += w * source[row, x, k]
        for x in range(target.shape[1]):
            red, green, blue = _ZERO, _ZERO, _ZERO
            for i in range(columns.shape[1]):
                column, w = columns[x, i], column_weight[x, i]
                red += w * line[column, 0]
                green += w * line[column, 1]
                blue += w * line[column, 2]
            target[y, x, 0] = mix[0] * target[y, x, 0] + mix[1] * red
            target[y, x, 1] = mix[0] * target[y, x, 1] + mix[1] * green
            target[y, x, 2] = mix[0] * target[y, x, 2] + mix[1] * blue
