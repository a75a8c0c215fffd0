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

CHANNELS = 4
"""Numbers of a pixel: red, green, blue, alpha."""

OUTER, INNER = np.float32(1 / 8), np.float32(3 / 8)
"""Weights of four pixels that become one."""

FAR, NEAR = np.float32(1 / 4), np.float32(3 / 4)
"""Weights of two pixels that meet in one of twice as many."""


def bloom(image: Array, film: Film) -> None:
    """Spread the colour of image (h, w, 4), contiguous, in place; alpha stays."""
    octaves = min(film.bloom_radius, int(np.log2(max(min(image.shape[:2]) // 4, 1))))
    if film.bloom <= 0 or octaves < 1:
        return
    pyramid = [image]
    for _ in range(octaves):
        height, width = pyramid[-1].shape[:2]
        pyramid.append(np.empty((-(-height // 2), -(-width // 2), 4), np.float32))
        _by_rows(_halve, pyramid[-2], pyramid[-1])
    # From the widest to the finest: each holds the mean of itself and all that are wider.
    for octave in range(octaves, 1, -1):
        wider = (octaves - octave + 1) / (octaves - octave + 2)
        _by_rows(_double, pyramid[octave], pyramid[octave - 1], 1 - wider, wider)
    _by_rows(_double, pyramid[1], image, 1 - film.bloom, film.bloom)


def _by_rows(kernel: Any, source: Array, target: Array, *mix: float) -> None:
    """Let the threads share the rows of the target, each of `CHANNELS` numbers a pixel."""
    tasks = blocks(len(target), ROWS)
    lines, rows = source.reshape(len(source), -1), target.reshape(len(target), -1)
    numbers = tuple(map(np.float32, mix))
    share(lambda number: kernel(lines, rows, *numbers, *tasks[number]), len(tasks))


@jit
def _halve(source: Any, target: Any, low: Any, high: Any) -> None:
    """target = source at half the size: (1, 3, 3, 1)/8 along columns, then along rows."""
    height, numbers = source.shape
    line = np.empty(numbers + 4 * CHANNELS, np.float32)  # Two pixels of border at either end.
    inner, out = line[2 * CHANNELS :][:numbers], target.shape[1] // CHANNELS
    for y in range(low, high):
        a, b = source[max(2 * y - 1, 0)], source[2 * y]
        c, d = source[min(2 * y + 1, height - 1)], source[min(2 * y + 2, height - 1)]
        for i in range(numbers):
            inner[i] = OUTER * (a[i] + d[i]) + INNER * (b[i] + c[i])
        _extend(line)
        row = target[y]
        for x in range(out):
            for k in range(CHANNELS):
                i = (2 * x + 1) * CHANNELS + k
                outer = line[i] + line[i + 3 * CHANNELS]
                row[x * CHANNELS + k] = OUTER * outer + INNER * (
                    line[i + CHANNELS] + line[i + 2 * CHANNELS]
                )


@jit
def _double(source: Any, target: Any, keep: Any, gain: Any, low: Any, high: Any) -> None:
    """target = keep target + gain (source at twice the size), in its colours."""
    height, numbers = source.shape
    line = np.empty(numbers + 4 * CHANNELS, np.float32)
    inner, out = line[2 * CHANNELS :][:numbers], target.shape[1] // CHANNELS
    near, far = gain * NEAR, gain * FAR
    for y in range(low, high):
        a = source[y // 2]
        b = source[min(max(y // 2 + 2 * (y % 2) - 1, 0), height - 1)]
        for i in range(numbers):
            inner[i] = NEAR * a[i] + FAR * b[i]
        _extend(line)
        row = target[y]
        for x in range(out):
            i = (x // 2 + 2) * CHANNELS
            j = i + (2 * (x % 2) - 1) * CHANNELS
            for k in range(3):
                light = near * line[i + k] + far * line[j + k]
                row[x * CHANNELS + k] = keep * row[x * CHANNELS + k] + light


@jit(inline=True)
def _extend(line: Any) -> None:
    """Let the two pixels of border at either end of a line be as the last ones within."""
    last = line.size - 3 * CHANNELS
    for k in range(CHANNELS):
        line[k] = line[CHANNELS + k] = line[2 * CHANNELS + k]
        line[last + CHANNELS + k] = line[last + 2 * CHANNELS + k] = line[last + k]
