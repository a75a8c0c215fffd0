"""The tables of a scene: camera, film, sky, and the box that repeats."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import field_validator

from motes.catalog.parameter import quantity
from motes.control.control import Control
from motes.scene.section import Section, fault


class Camera(Section):
    """Where the scene is seen from; each value may be a curve over time."""

    noun: ClassVar[str] = "camera"

    position: Control = quantity((3.0, -6.0, 2.0), "m", scope="scene")
    """Where the camera stands."""

    look_at: Control = quantity((0.0, 0.0, 1.0), "m", scope="scene")
    """The point in the middle of the picture."""

    up: Control = quantity((0.0, 0.0, 1.0), "", scope="scene")
    """The direction that is upright in the picture."""

    field_of_view: Control = quantity(40.0, "degrees", above=0, below=180, scope="scene")
    """Angle from the lower to the upper edge of the picture."""


class Film(Section):
    """What the scene is recorded on: frames, size and how light becomes display values."""

    noun: ClassVar[str] = "film"

    fps: float = quantity(24.0, "1/s", above=0, at_most=1000)
    """Frames per second of the film; the motion does not depend on it."""

    size: tuple[int, int] = quantity(
        (1280, 720), "pixels", shape="pair", at_least=16, at_most=16384
    )
    """Width and height, both even, as codecs of video need them."""

    shutter: float = quantity(0.5, "", at_least=0, at_most=1)
    """Share of a frame's time in which the shutter is open; it draws streaks."""

    exposure: Control = quantity(0.0, "EV", at_least=-20, at_most=20, scope="scene")
    """Brightness; every 1 more doubles the light."""

    tone: Literal["agx", "filmic", "srgb"] = quantity("agx", menu=("agx", "filmic", "srgb"))
    """agx: soft highlights that go to white; filmic: more contrast; srgb: clipped, for data."""

    bloom: float = quantity(0.05, "", at_least=0, at_most=1)
    """Share of the light that the lens spreads around bright places."""

    background: Literal["sky", "transparent"] = quantity("sky", menu=("sky", "transparent"))
    """What is behind everything; transparent stills have an alpha channel."""

    @field_validator("size")
    @classmethod
    def _even(cls, size: tuple[int, int]) -> tuple[int, int]:
        if size[0] % 2 or size[1] % 2:
            raise fault(f"film: size = [{size[0]}, {size[1]}] pixels must be two even numbers.")
        return size


class Sky(Section):
    """What is behind everything and lights it; each value may be a curve over time."""

    noun: ClassVar[str] = "sky"

    zenith: Control = quantity("#4b6fa6", at_least=0, scope="scene")
    """Colour straight above."""

    horizon: Control = quantity("#a2b1c2", at_least=0, scope="scene")
    """Colour at the horizon, and of the haze in which far solids fade."""

    ground: Control = quantity("#656159", at_least=0, scope="scene")
    """Colour below the horizon."""

    sun_direction: Control = quantity((-0.6, -0.45, 0.7), "", scope="scene")
    """Direction towards the sun."""

    sun_color: Control = quantity("#fff4e3", at_least=0, scope="scene")
    """Colour of the sun's light."""

    sun_strength: Control = quantity(1.5, "", at_least=0, at_most=1000, scope="scene")
    """Light on a surface that faces the sun, as a multiple of its colour; 0 for none."""

    stars: Control = quantity(0, "", at_least=0, at_most=100_000, scope="scene")
    """How many stars there are in the whole sky."""


class Periodic(Section):
    """A box that repeats: who leaves it on one side comes in on the other.

    Particles feel the nearest images of others. Laws between particles must not reach further than
    half of a period.
    """

    noun: ClassVar[str] = "periodic"

    low: Any = quantity((0.0, 0.0, 0.0), "m", scope="fixed")
    """The corner with the smallest coordinates."""

    size: Any = quantity((0.0, 0.0, 0.0), "m", at_least=0, scope="fixed")
    """Lengths after which space repeats along x, y and z; 0 where it does not."""
