"""Pictures of particles: camera, layers, sky and solids in, linear light, PNG and film out.

The renderer knows nothing of scenes. One frame is `Renderer(film).draw(layers, camera, ...)`; the
light stays linear float32 from the first splat to the tone map of `Picture`.
"""

from motes.render.camera import Camera
from motes.render.film import Film
from motes.render.layer import Layer
from motes.render.picture import Picture
from motes.render.renderer import Renderer
from motes.render.sky import Sky, Stars, Sun
from motes.render.solids import Solids
from motes.render.video import Video, contact_sheet

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
