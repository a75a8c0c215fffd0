"""A plane, the ground of most scenes."""

from motes.catalog import component
from motes.kernel import kernel


@component
class Plane:
    """Everything below z = 0 of its own frame is solid."""

    flat = True

    @kernel
    def distance(p, x, y, z):
        return z
