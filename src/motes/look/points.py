"""Round dots."""

from motes.catalog import component


@component
class Points:
    """Round dots with a soft edge, where the particles are at the frame's instant."""

    drawn_as = "points"
