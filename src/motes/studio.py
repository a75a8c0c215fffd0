"""The studio: a scene's camera, sky, solids and looks, set up for the renderer at a time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.compile.surfaces import write_surfaces
from motes.compile.text import Text
from motes.control.control import Control
from motes.control.curve import Curve
from motes.errors import SceneError
from motes.figure import assembled
from motes.frame import Frame
from motes.renderer import Camera, Film, Layer, Picture, Renderer, Sky, Solids, Stars, Sun
from motes.scene.address import component_address
from motes.scene.document import Scene, a_scene


def picture(frame: Frame, scene: Scene, *, size: tuple[int, int] | None = None) -> Picture:
    """Draw one frame of a scene. `size` is (width, height) [pixels], by default the film's.

    For many frames, a `Studio` remembers what stays the same.
    """
    return Studio(scene, size=size).draw(frame)


class Studio:
    """Draws frames of one scene; backdrops that do not change are drawn once."""

    def __init__(self, scene: Scene, *, size: tuple[int, int] | None = None) -> None:
        self.scene = a_scene(scene)
        film = scene.film
        width, height = size or film.size
        self._film = Film(size=(int(width), int(height)), tone=film.tone, bloom=float(film.bloom))
        self._renderers: dict[float, Renderer] = {}
        self._shutter = float(film.shutter) / float(film.fps)
        self._looks = {system.name: system.look for system in scene.systems}

    def draw(self, frame: Frame) -> Picture:
        """The picture of one frame; the shutter opens at its time."""
        time = frame.time
        return self._renderer(time).draw(
            [self._layer(name, columns, time) for name, columns in frame.systems.items()],
            self._camera(time),
            shutter=self._shutter,
            sky=None if self.scene.film.background == "transparent" else self._sky(time),
            solids=self._solids(time),
        )

    def _renderer(self, time: float) -> Renderer:
        exposure = _one(self.scene.film.exposure, time)
        if exposure not in self._renderers:
            film = Film(**{**self._film.__dict__, "exposure": exposure})
            self._renderers = {exposure: Renderer(film)}
        return self._renderers[exposure]

    def _camera(self, time: float) -> Camera:
        camera = self.scene.camera
        controls = (camera.position, camera.look_at, camera.up, camera.field_of_view)
        moves = any(isinstance(control, Curve) for control in controls)
        return self._pose(time, self._pose(time + self._shutter) if moves else None)

    def _pose(self, time: float, close: Camera | None = None) -> Camera:
        camera = self.scene.camera
        return Camera(
            position=_three(camera.position, time),
            look_at=_three(camera.look_at, time),
            up=_three(camera.up, time),
            field_of_view=_one(camera.field_of_view, time),
            close=close,
        )

    def _sky(self, time: float) -> Sky:
        sky = self.scene.sky
        strength = _one(sky.sun_strength, time)
        red, green, blue = (strength * c for c in _three(sky.sun_color, time))
        stars = int(_one(sky.stars, time))
        return Sky(
            zenith=_three(sky.zenith, time),
            horizon=_three(sky.horizon, time),
            ground=_three(sky.ground, time),
            sun=Sun(_three(sky.sun_direction, time), (red, green, blue)) if strength else None,
            stars=Stars(stars) if stars else None,
        )

    def _layer(self, name: str, columns: Mapping[str, NDArray[Any]], time: float) -> Layer:
        look = self._looks.get(name)
        if look is None:
            menu = ", ".join(self._looks) or "none"
            raise SceneError(
                f'the frame has a system "{name}", and the scene has {menu}: '
                "the frame was made of another scene.",
                source="",
            )
        figure = type(look).kernel("figure")
        if figure is not None:
            own = vars(type(look))
            p = SimpleNamespace(upright=own["upright"], rate=own.get("rate", 0.0))
            for key in look.own:
                value = look.values[key].at(time)
                setattr(p, key, float(value[0]) if value.size == 1 else value)
            columns = assembled(figure, p, columns, time)
        return Layer(
            position=columns["position"],
            velocity=columns["velocity"],
            color=columns["color"],
            size=columns["size"],
            kind=vars(type(look))["drawn_as"],
            emission=_one(look.values["emission"], time),
            opacity=_one(look.values["opacity"], time),
            softness=_one(look.values["softness"], time),
            trail=_one(look.values["trail"], time) if "trail" in look.values else 0.0,
            age=columns["age"],
        )

    @cached_property
    def _visible(self) -> tuple[list[tuple[str, Component]], list[Component]]:
        """Solids that are drawn: the bent ones with their addresses, then the flat ones."""
        solids = [s for s in self.scene.solid if s.values["visible"].document()]
        flat = [s for s in solids if getattr(type(s), "flat", False)]
        return [(component_address(None, s), s) for s in solids if s not in flat], flat

    @cached_property
    def _shapes(self) -> tuple[Any, Any, Any, int]:
        """Kernels `place` and `nearest` of the bent solids, and what they read."""
        text = Text("single")
        surfaces = write_surfaces(text, self._visible[0])
        text.add(text.values.scene_text())
        entries = surfaces.length
        text.add(
            "@kernel\ndef place(K, t, out):\n    D = solids(scene(K, t))\n"
            f"    for i in range({entries}):\n        out[i] = D[i]\n"
        )
        row = ", ".join(f"params[{i}]" for i in range(entries))
        text.add(f"@inline\ndef nearest(params, x, y, z):\n    return near(({row},), x, y, z)\n")
        module = text.module()
        return module["place"], module["nearest"], text.values.arrays(np.float32), entries

    def _solids(self, time: float) -> Solids | None:
        bent, flat = self._visible
        if not bent and not flat:
            return None
        nearest, params = None, np.empty(0, np.float32)
        if bent:
            place, nearest, K, entries = self._shapes
            params = np.empty(entries, np.float32)
            place(K, time, params)
        solids = [*(s for _, s in bent), *flat]
        colors = np.array([s.values["color"].at(time)[:3] for s in solids])
        return Solids(nearest, params, colors, np.array([_plane(s, time) for s in flat]))


def _plane(solid: Component, time: float) -> NDArray[np.float64]:
    """Unit normal and offset (4,) of a flat solid, whose distance is linear in its own frame."""
    distance = solid.kernel("distance")
    assert distance is not None
    own = {key: solid.values[key].at(time) for key in solid.own}
    p = SimpleNamespace(**{key: v if len(v) > 1 else float(v[0]) for key, v in own.items()})
    level = distance(p, 0.0, 0.0, 0.0)
    slope = np.array([distance(p, *axis) - level for axis in np.eye(3)])
    (cx, cy, cz), (sx, sy, sz) = (
        f(np.radians(_three(solid.values["rotation"], time))) for f in (np.cos, np.sin)
    )
    around_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    around_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    around_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    normal = around_z @ around_y @ around_x @ slope
    return np.append(normal, normal @ _three(solid.values["position"], time) - level)


def _one(control: Control, time: float) -> float:
    return float(control.at(time)[0])


def _three(control: Control, time: float) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in control.at(time)[:3])
    return x, y, z
