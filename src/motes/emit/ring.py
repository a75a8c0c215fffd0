"""A ring."""

from motes.catalog import Number, component, quantity
from motes.emit._directions import disc_point
from motes.kernel import kernel, sqrt


@component
class Ring:
    """Births spread evenly over a flat ring; they may start along the axis, outward or around."""

    radius: Number = quantity(1.0, "m", at_least=0)
    """Outer radius of the ring."""

    inner: Number = quantity(1.0, "m", at_least=0)
    """Inner radius; equal to the outer one for a circle."""

    speed: Number = quantity(0.0, "m/s")
    """Speed at birth, along the emitter's axis."""

    outward: Number = quantity(0.0, "m/s")
    """Speed away from the axis."""

    around: Number = quantity(0.0, "m/s")
    """Speed around the axis, counterclockwise seen from where it points."""

    draws = 2

    @kernel
    def birth(p, u, t, k):
        x, y = disc_point(p.inner, p.radius, u[0], u[1])
        scale = 1.0 / max(sqrt(x * x + y * y), 1e-30)
        cx, cy = x * scale, y * scale
        vx = p.outward * cx - p.around * cy
        vy = p.outward * cy + p.around * cx
        return x, y, 0.0, vx, vy, p.speed
