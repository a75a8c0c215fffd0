"""Motion-blurred lines."""

from motes.catalog import component


@component
class Streaks:
    """Each particle drawn as the line that it covers while the shutter is open."""

    drawn_as = "streaks"
