"""Pictures of particles: camera, layers, sky and solids in, linear light, PNG and film out.

The renderer knows nothing of scenes. One frame is `Renderer(film).draw(layers, camera, ...)`; the
light stays linear float32 from the first splat to the tone map of `Picture`.
"""

from motes.renderer.camera import Camera
from motes.renderer.film import Film
from motes.renderer.layer import Layer
from motes.renderer.picture import Picture
from motes.renderer.renderer import Renderer
from motes.renderer.sky import Sky, Stars, Sun
from motes.renderer.solids import Solids
from motes.renderer.video import Video, contact_sheet

__all__ = [
    "Camera",
    "Film",
    "Layer",
    "Picture",
    "Renderer",
    "Sky",
    "Solids",
    "Stars",
    "Sun",
    "Video",
    "contact_sheet",
]
