"""What receives the light: size, exposure, glow and the way to eight bits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

ToneMap = Literal["agx", "filmic", "srgb"]


@dataclass(frozen=True)
class Film:
    """Size of a picture and how its linear light becomes display values."""

    size: tuple[int, int] = (1280, 720)
    """Width and height [pixels]."""

    exposure: float = 0.0
    """Light is multiplied by 2^exposure before the tone map [EV]."""

    tone: ToneMap = "agx"
    """agx: soft highlights that go to white; filmic: more contrast; srgb: clipped, for data."""

    bloom: float = 0.04
    """Fraction of the light that the lens spreads, 0 to 1; the total stays."""

    bloom_radius: int = 5
    """Octaves of the glow: the widest reaches about 2^bloom_radius pixels."""

    dither: bool = True
    """Trade the steps of eight bits for noise of half a step."""

    def __post_init__(self) -> None:
        if min(self.size) < 1:
            raise ValueError(f"size must be at least 1 x 1 pixels, not {self.size}")
        if not 0.0 <= self.bloom <= 1.0:
            raise ValueError(f"bloom must be between 0 and 1, not {self.bloom}")
        if self.tone not in get_args(ToneMap):
            raise ValueError(f"tone must be one of {', '.join(get_args(ToneMap))}, not {self.tone}")
