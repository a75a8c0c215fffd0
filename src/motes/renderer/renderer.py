"""One frame: backdrop, lamps, particles, glow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from motes.renderer.backdrop import Backdrop, backdrop
from motes.renderer.bloom import bloom
from motes.renderer.camera import Camera, Vector
from motes.renderer.film import Film
from motes.renderer.lamps import gather
from motes.renderer.layer import Layer
from motes.renderer.picture import Picture
from motes.renderer.sky import Sky
from motes.renderer.solids import Solids
from motes.renderer.splat import splat


class Renderer:
    """Draws frames on one film.

    It remembers the last backdrop, so that frames in which neither camera nor solids nor sky change
    trace nothing again.
    """

    def __init__(self, film: Film | None = None) -> None:
        self.film = film or Film()
        self._seen: tuple[Camera, Sky | None, Solids | None] | None = None
        self._backdrop: Backdrop | None = None

    def draw(
        self,
        layers: Sequence[Layer],
        camera: Camera,
        *,
        shutter: float = 0.0,
        sky: Sky | None = None,
        solids: Solids | None = None,
        light: Vector | None = None,
    ) -> Picture:
        """One frame.

        Args:
            layers: what to draw; all particles of all layers are sorted together.
            camera: at the opening of the shutter; the backdrop does not blur.
            shutter: how long it is open [s], the length of streaks in time.
            sky: None leaves the picture clear where nothing is.
            solids: hide and are hidden by particles, and are lit by those that shine.
            light: what particles with opacity scatter per color beside the light of others; None:
                the light of the sky.
        """
        behind = self._behind(camera, sky, solids)
        light = light or (sky or Sky()).light
        lamps = gather(layers, max(light))
        image = behind.image
        if sky and solids:
            image = behind.lit(lamps, solids.colors, sky.haze)
        stars = sky.star_layer(camera, self.film.size) if sky else []
        linear = splat(
            [*layers, *stars],
            camera,
            image,
            shutter=shutter,
            light=light,
            lamps=lamps,
            depths=behind.depths,
        )
        bloom(linear, self.film)
        return Picture(linear, self.film)

    def _behind(self, camera: Camera, sky: Sky | None, solids: Solids | None) -> Backdrop:
        wanted = (replace(camera, close=None), sky, solids)
        if self._backdrop is None or self._seen != wanted:
            self._backdrop = backdrop(camera, self.film.size, sky, solids)
            self._seen = wanted
        return self._backdrop
