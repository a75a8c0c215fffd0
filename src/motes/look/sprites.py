"""Soft discs parallel to the image plane."""

from motes.catalog import component


@component
class Sprites:
    """Soft discs parallel to the image plane, for smoke, mist and fire."""

    drawn_as = "sprites"
