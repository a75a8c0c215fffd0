"""Figures: particles drawn as bodies that point where they go, each put together from soft dots.

A look that defines `figure(p, phase, pace)` gives the parts of one body, in units of the particle's
size: forward, left and up from its place, diameter, shade (a factor of the colour, or a colour of
its own) and alpha. `phase` (n,) runs with time, one cycle at a time for each particle [radians];
`pace` (n,) is the speed in sizes a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Part(NamedTuple):
    """One dot of a figure; every number may be one for all or (n,), one a particle."""

    forward: Any
    left: Any
    up: Any
    size: Any
    shade: Any = 1.0
    alpha: float = 1.0
    turns: bool = True
    """Whether it turns with the body; else forward, left and up are x, y and z."""


def assembled(figure: Any, p: Any, columns: Mapping[str, Array], time: float) -> dict[str, Array]:
    """Columns of the dots of all figures: `position`, `velocity`, `color`, `size`, `age`.

    `upright` figures keep their feet on the ground: only their heading turns.
    """
    velocity, size = columns["velocity"], columns["size"]
    speed = np.sqrt((velocity * velocity).sum(axis=1))
    own = (columns["id"] >> np.uint64(11)) / 2.0**53
    phase = 2 * np.pi * (p.rate * time + own)
    frame = _frame(velocity, p.upright)
    parts = [Part(*part) for part in figure(p, phase, speed / np.maximum(size, 1e-9))]
    dots: dict[str, list[Array]] = {"position": [], "color": [], "size": []}
    for part in parts:
        offsets = (part.forward, part.left, part.up)
        axes = frame if part.turns else np.eye(3)
        away = sum(np.multiply(o, size)[:, None] * a for o, a in zip(offsets, axes, strict=True))
        dots["position"].append(columns["position"] + away)
        color = columns["color"].copy()
        if isinstance(part.shade, tuple):
            color[:, :3] = part.shade
        else:
            color[:, :3] *= part.shade
        color[:, 3] *= part.alpha
        dots["color"].append(color)
        dots["size"].append(np.multiply(part.size, size))
    joined = {name: np.concatenate(rows) for name, rows in dots.items()}
    for name in ("velocity", "age"):
        joined[name] = np.concatenate([columns[name]] * len(parts))
    return joined


def _frame(velocity: Array, upright: bool) -> tuple[Array, Array, Array]:
    """Unit vectors forward, left and up (n, 3) of bodies that move with a velocity."""
    forward = velocity.astype(float)
    if upright:
        forward[:, 2] = 0.0
    length = np.sqrt((forward * forward).sum(axis=1, keepdims=True))
    forward = np.where(length > 1e-6, forward / np.maximum(length, 1e-6), [1.0, 0.0, 0.0])
    left = np.cross([0.0, 0.0, 1.0], forward)
    wide = np.sqrt((left * left).sum(axis=1, keepdims=True))
    left = np.where(wide > 1e-6, left / np.maximum(wide, 1e-6), [0.0, 1.0, 0.0])
    return forward, left, np.cross(forward, left)
