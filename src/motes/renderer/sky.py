"""What is behind everything: a gradient, a sun, stars; and the light that they give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import jit
from motes.renderer.camera import Camera, Vector
from motes.renderer.layer import Layer

_ZERO = np.float32(0)
_ONE = np.float32(1)


@dataclass(frozen=True)
class Sun:
    """A far light with its glow in the sky."""

    direction: Vector = (-0.6, -0.45, 0.7)
    """Towards the sun."""

    color: Vector = (1.5, 1.36, 1.15)
    """Light on a surface that faces it."""

    softness: float = 0.03
    """Half width of the edge of a shadow per distance to what throws it; 0 is hard."""

    glow: float = 0.25
    """Brightness of the halo per color; 0 for none."""


@dataclass(frozen=True)
class Stars:
    """Points at infinity, evenly spread."""

    count: int = 3000
    """Stars on the whole sphere."""

    brightness: float = 1.0
    """Radiance of the brightest in the middle of its 4 pixels."""


@dataclass(frozen=True)
class Sky:
    """A gradient in the height of the view: zenith, horizon, and below it the ground."""

    zenith: Vector = (0.07, 0.16, 0.38)
    """Linear light straight above."""

    horizon: Vector = (0.36, 0.44, 0.54)
    """Linear light at the horizon; also the haze in which far solids fade."""

    ground: Vector = (0.13, 0.12, 0.10)
    """Linear light from below."""

    sun: Sun | None = Sun()
    """None for an overcast day or night."""

    stars: Stars | None = None
    """None for none."""

    haze: float = 200.0
    """Distance over which solids fade into the horizon by 1/e [m]."""

    @classmethod
    def plain(cls, color: Vector) -> Sky:
        """The same light from everywhere."""
        return cls(color, color, color, sun=None)

    @property
    def light(self) -> Vector:
        """What matter without a surface scatters: the mean of the sky, and half of the sun."""
        sun = self.sun.color if self.sun else (0.0, 0.0, 0.0)
        zenith, horizon, ground = self.zenith, self.horizon, self.ground
        red, green, blue = (
            0.35 * zenith[k] + 0.35 * horizon[k] + 0.3 * ground[k] + 0.5 * sun[k] for k in range(3)
        )
        return red, green, blue

    def star_layer(self, camera: Camera, size: tuple[int, int]) -> list[Layer]:
        """The stars as one layer of points around the camera, or none."""
        if self.stars is None:
            return []
        n = self.stars.count
        u = np.random.Philox(key=1).random_raw(3 * n).reshape(n, 3) * 2.0**-64
        height, angle = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
        flat = np.sqrt(1 - height * height)
        away = 1e6
        direction = np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1)
        # Star counts grow by 10^(0.6 m) with magnitude m, so brightness is a power of rank.
        flux = self.stars.brightness * 0.02 / (0.02 + u[:, 2] ** 1.5)
        warm = ((u[:, 2] * 97) % 1.0)[:, None]
        color = np.ones((n, 4))
        color[:, :3] = ((1 - warm) * (0.75, 0.85, 1.0) + warm * (1.0, 0.85, 0.7)) * flux[:, None]
        width = np.full(n, 3.8 * away / camera.focal(size[1]))
        position = np.asarray(camera.position) + away * direction
        single = np.float32
        return [
            Layer(
                position.astype(single),
                np.zeros((n, 3), single),
                color.astype(single),
                width.astype(single),
            )
        ]

    def numbers(self) -> NDArray[np.float32]:
        """All of it as the kernel reads it: 5 rows of 3."""
        sun = self.sun or Sun(color=(0.0, 0.0, 0.0))
        rows = [self.zenith, self.horizon, self.ground, sun.color, _unit(sun.direction)]
        return np.array([*rows, (sun.glow, 1.0 / self.haze, 0.0)], np.float32)


def _unit(vector: Vector) -> NDArray[np.float64]:
    length = float(np.linalg.norm(vector))
    return np.divide(vector, length) if length > 0 else np.array([0.0, 0.0, 1.0])


@jit
def shade(
    rays: Any, distance: Any, normal: Any, index: Any, lit: Any, colors: Any, sky: Any, out: Any
) -> None:
    """Radiance along rays (n, 3): the sky where distance is infinite, else the solid that is hit.

    A solid gives color (ambient(normal) + sun max(normal . sun, 0) lit), ambient being the sky
    averaged about the normal, and fades into the haze of the horizon with exp(-distance / haze).
    """
    glow, per_haze = sky[5, 0], sky[5, 1]
    for i in range(rays.shape[0]):
        x, y, z = rays[i, 0], rays[i, 1], rays[i, 2]
        hit = distance[i] < np.float32(np.inf)
        seen = _ZERO
        if hit:
            seen = np.exp(-distance[i] * per_haze)
        # The haze is the sky on the horizon; below it the ground rises out of it quickly.
        up = _ONE - max(z, _ZERO)
        high = _ZERO if hit else _ONE - up * up * up
        down = _ONE + min(z, _ZERO)
        down *= down
        low = _ZERO if hit else _ONE - down * down * down * down
        toward = x * sky[4, 0] + y * sky[4, 1] + z * sky[4, 2]
        halo = np.exp((toward - _ONE) * np.float32(6)) * np.float32(0.35)
        halo += np.exp((toward - _ONE) * np.float32(120))
        halo *= glow * (_ONE - low)
        facing, upward = _ZERO, _ZERO
        if hit:
            facing = normal[i, 0] * sky[4, 0] + normal[i, 1] * sky[4, 1] + normal[i, 2] * sky[4, 2]
            facing = max(facing, _ZERO) * lit[i]
            upward = np.float32(0.5) + np.float32(0.5) * normal[i, 2]
        for k in range(3):
            far = sky[1, k] + high * (sky[0, k] - sky[1, k]) + low * (sky[2, k] - sky[1, k])
            far += halo * sky[3, k]
            if hit:
                above = np.float32(0.5) * (sky[0, k] + sky[1, k])
                ambient = sky[2, k] + upward * (above - sky[2, k])
                near = colors[index[i], k] * (ambient + sky[3, k] * facing)
                far += seen * (near - far)
            out[i, k] = far
        out[i, 3] = _ONE
