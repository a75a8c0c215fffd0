"""Colours: sRGB text for people, linear numbers for light."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from motes.control.control import Values

_HEX = re.compile(r"#([0-9a-fA-F]{6})([0-9a-fA-F]{2})?\Z")

BRIGHTEST = 1e30
"""Light beyond it would overflow in single precision."""


def parse_color(value: Any, name: str = "color") -> Values:
    """Linear red, green, blue and alpha from "#rrggbb[aa]" (sRGB) or 3 or 4 linear numbers.

    Raises ValueError with one line.
    """
    if isinstance(value, str):
        match = _HEX.match(value)
        if match is None:
            raise ValueError(f'{name} must be "#rrggbb" or "#rrggbbaa", not "{value[:40]}".')
        encoded = np.array([int(match[1][i : i + 2], 16) for i in (0, 2, 4)]) / 255
        alpha = int(match[2], 16) / 255 if match[2] else 1.0
        return np.append(linear(encoded), alpha)
    if isinstance(value, Sequence | np.ndarray) and len(value) in (3, 4):
        numbers = []
        for v in value:
            if isinstance(v, bool) or not isinstance(v, int | float | np.number):
                raise ValueError(f"{name} must have numbers, not {v!r}.")
            numbers.append(_finite(v, name))
        return np.array([*numbers, 1.0][:4])
    raise ValueError(f'{name} must be "#rrggbb" or [red, green, blue], not {str(value)[:40]}.')


def _finite(value: Any, name: str) -> float:
    if not -BRIGHTEST <= value <= BRIGHTEST:
        raise ValueError(f"{name} must have finite numbers up to {BRIGHTEST:g}.")
    return float(value)


def linear(encoded: Values) -> Values:
    """sRGB values in 0 to 1 to linear light (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encoded(light: Values) -> Values:
    """Linear light to sRGB values: the inverse of `linear`."""
    high = 1.055 * np.maximum(light, 0.0) ** (1 / 2.4) - 0.055
    return np.where(light <= 0.0031308, 12.92 * light, high)
