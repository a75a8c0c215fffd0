"""From linear light to eight bits: exposure, tone map, sRGB encoding, dither.

Every tone map here is a matrix, a curve per channel, a second matrix and an encoding, so one kernel
with two tables serves all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share
from motes.renderer.film import Film, ToneMap

Array = NDArray[np.float32]

ROWS = 32
"""Rows of pixels per task."""

# The curve's table is indexed by the float's own bits: 32 cells in each octave of light.
_SHIFT = np.uint32(18)
_FRACTION = np.uint32((1 << 18) - 1)
_PER_CELL = np.float32(2.0**-18)
_DIMMEST = np.float32(2.0**-16)
_BRIGHTEST = np.float32(2.0**12 * (1 - 2**-20))
_FIRST_BITS = np.uint32(_DIMMEST.view(np.uint32))
_CODES = 4096
_ZERO = np.float32(0)
_ONE = np.float32(1)


@dataclass(frozen=True, eq=False)
class _Tone:
    into: Array
    """(3, 3) from linear sRGB to the space of the curve."""

    curve: Array
    """Display light per scene light, at the cells of the float's bits."""

    out: Array
    """(3, 3) back to sRGB."""

    code: Array
    """sRGB code, 0 to 1, at even steps of what `out` gives."""


def develop(linear: Array, film: Film) -> NDArray[np.uint8]:
    """Display values (h, w, 3) of linear light (h, w, 4), premultiplied, over black."""
    tone = _tone(film.tone)
    pixels = np.empty((*linear.shape[:2], 3), np.uint8)
    into = (tone.into * 2.0**film.exposure).astype(np.float32)
    tasks = blocks(len(linear), ROWS)

    def task(number: int) -> None:
        first, last = tasks[number]
        part = linear[first:last]
        _develop(
            part, into, tone.curve, tone.out, tone.code, film.dither, first, pixels[first:last]
        )

    share(task, len(tasks))
    return pixels


@jit
def _develop(
    linear: Any, into: Any, curve: Any, out: Any, code: Any, dither: Any, first: Any, pixels: Any
) -> None:
    """Row by row and step by step, so that all but the looking up is done on SIMD registers."""
    width = linear.shape[1]
    cells, parts = np.empty((3, width), np.uint32), np.empty((3, width), np.float32)
    c0, c1, c2 = cells[0], cells[1], cells[2]
    p0, p1, p2 = parts[0], parts[1], parts[2]
    noise = np.empty(width, np.float32)
    for x in range(width):
        noise[x] = np.float32(0.5)
    for y in range(linear.shape[0]):
        light = linear[y]
        for x in range(width):
            red, green, blue = light[x, 0], light[x, 1], light[x, 2]
            c0[x], p0[x] = _octave(into[0, 0] * red + into[0, 1] * green + into[0, 2] * blue)
            c1[x], p1[x] = _octave(into[1, 0] * red + into[1, 1] * green + into[1, 2] * blue)
            c2[x], p2[x] = _octave(into[2, 0] * red + into[2, 1] * green + into[2, 2] * blue)
        _look_up(curve, c0, c1, c2, p0, p1, p2)
        for x in range(width):
            red, green, blue = p0[x], p1[x], p2[x]
            c0[x], p0[x] = _step(out[0, 0] * red + out[0, 1] * green + out[0, 2] * blue)
            c1[x], p1[x] = _step(out[1, 0] * red + out[1, 1] * green + out[1, 2] * blue)
            c2[x], p2[x] = _step(out[2, 0] * red + out[2, 1] * green + out[2, 2] * blue)
        _look_up(code, c0, c1, c2, p0, p1, p2)
        if dither:  # Interleaved gradient noise (Jimenez 2014): uniform, without visible grain.
            row = np.float32(0.00583715) * np.float32(y + first)
            for x in range(width):
                wave = np.float32(0.06711056) * np.float32(np.int32(x)) + row
                wave = np.float32(52.9829189) * (wave - np.floor(wave))
                noise[x] = wave - np.floor(wave)
        shown = pixels[y]
        for x in range(width):
            shown[x, 0] = np.uint8(np.int32(p0[x] * np.float32(255) + noise[x]))
            shown[x, 1] = np.uint8(np.int32(p1[x] * np.float32(255) + noise[x]))
            shown[x, 2] = np.uint8(np.int32(p2[x] * np.float32(255) + noise[x]))


@jit(inline=True)
def _octave(light: Any) -> Any:
    """Cell of the curve's table, and how far light is within it."""
    light = light if light > _DIMMEST else _DIMMEST  # Also where it is NaN.
    bits = np.float32(min(light, _BRIGHTEST)).view(np.uint32) - _FIRST_BITS
    return np.uint32(bits >> _SHIFT), np.float32(np.int32(bits & _FRACTION)) * _PER_CELL


@jit(inline=True)
def _step(value: Any) -> Any:
    """Cell of the code's table, and how far a value is within it."""
    value = min(max(value, _ZERO), _ONE) * np.float32(_CODES)
    cell = np.int32(min(np.int32(value), np.int32(_CODES - 1)))
    return np.uint32(cell), value - np.float32(cell)


@jit(inline=True)
def _look_up(table: Any, c0: Any, c1: Any, c2: Any, p0: Any, p1: Any, p2: Any) -> None:
    """Put into each part what the table has there."""
    for x in range(p0.size):
        low = table[c0[x]]
        p0[x] = low + p0[x] * (table[c0[x] + np.uint32(1)] - low)
        low = table[c1[x]]
        p1[x] = low + p1[x] * (table[c1[x] + np.uint32(1)] - low)
        low = table[c2[x]]
        p2[x] = low + p2[x] * (table[c2[x] + np.uint32(1)] - low)


@cache
def _tone(name: ToneMap) -> _Tone:
    octaves = np.arange((28 << 5) + 1, dtype=np.uint32)
    light = ((octaves << _SHIFT) + _FIRST_BITS).view(np.float32).astype(float)
    steps = np.arange(_CODES + 1) / _CODES
    same = np.eye(3)
    tables: tuple[NDArray[np.float64], ...]
    if name == "agx":
        inset = _AGX_INSET / _AGX_INSET.sum(axis=1, keepdims=True)
        outset = _SATURATION @ np.linalg.inv(inset)
        tables = inset, _agx_curve(light), outset, srgb_code(steps**2.2)
    elif name == "filmic":
        tables = same, _hable(light) / _hable(np.array(11.2)), same, srgb_code(steps)
    else:
        tables = same, np.minimum(light, 1.0), same, srgb_code(steps)
    return _Tone(*(np.ascontiguousarray(table, np.float32) for table in tables))


def srgb_code(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """Encode linear light, 0 to 1, by the transfer function of IEC 61966-2-1."""
    code: NDArray[np.float64] = np.where(
        light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055
    )
    return code


_AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)

# AgX alone is flat by design, to be graded: a fifth more colour about the Rec. 709 luma.
_SATURATION = 1.2 * np.eye(3) - 0.2 * np.array([0.2126, 0.7152, 0.0722])


def _agx_curve(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """T. Sobotka's AgX: a sigmoid of log2 light from 10 stops below middle grey to 6.5 above.

    Slope 2.4 through (grey, 0.5); toe and shoulder are x / (1 + x^p)^(1/p) with p = 3 and 2, scaled
    to reach 0 and 1 at the ends of the range.
    """
    grey, slope, height = 10 / 16.5, 2.4, 0.5
    x = np.clip((np.log2(light / 0.18) + 10) / 16.5, 0, 1) - grey

    def half(distance: NDArray[np.float64], reach: float, power: float) -> NDArray[np.float64]:
        scale = slope * reach * ((slope * reach / height) ** power - 1) ** (-1 / power)
        rise = slope * distance / scale
        bent: NDArray[np.float64] = scale * rise / (1 + rise**power) ** (1 / power)
        return bent

    toe = half(np.maximum(-x, 0), grey, 3.0)
    shoulder = half(np.maximum(x, 0), 1 - grey, 2.0)
    return height - toe + shoulder


def _hable(light: NDArray[np.float64]) -> NDArray[np.float64]:
    """J. Hable's filmic curve (Uncharted 2, GDC 2010), twice exposed as he does."""
    x = 2.0 * light
    curve: NDArray[np.float64] = (x * (0.15 * x + 0.05) + 0.004) / (
        x * (0.15 * x + 0.5) + 0.06
    ) - 0.02 / 0.3
    return curve
