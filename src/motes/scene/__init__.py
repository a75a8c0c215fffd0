"""The document: read, checked, addressed, written."""

from motes.scene.document import Scene, System, drawable, from_document
from motes.scene.gallery import gallery, gallery_text
from motes.scene.read import load, loads
from motes.scene.schema import schema
from motes.scene.sections import Camera, Film, Periodic, Sky

__all__ = [
    "Camera",
    "Film",
    "Periodic",
    "Scene",
    "Sky",
    "System",
    "drawable",
    "from_document",
    "gallery",
    "gallery_text",
    "load",
    "loads",
    "schema",
]
