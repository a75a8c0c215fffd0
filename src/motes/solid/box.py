"""A box."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel, sqrt


@component
class Box:
    """A box around its position, with rounded edges if wanted."""

    size: Vector = quantity((1.0, 1.0, 1.0), "m", above=0)
    """Edge lengths."""

    rounding: Number = quantity(0.0, "m", at_least=0)
    """Radius of its edges and corners, at most half the shortest edge."""

    @kernel
    def distance(p, x, y, z):
        dx = abs(x) - 0.5 * p.size[0] + p.rounding
        dy = abs(y) - 0.5 * p.size[1] + p.rounding
        dz = abs(z) - 0.5 * p.size[2] + p.rounding
        ox, oy, oz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
        outside = sqrt(ox * ox + oy * oy + oz * oz)
        inside = min(max(dx, max(dy, dz)), 0.0)
        return outside + inside - p.rounding
