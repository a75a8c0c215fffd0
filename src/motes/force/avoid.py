"""Steering around solids before they are hit."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Avoid:
    """Turns away from the nearest solid in time: a = w / 2 (w / g - 1 / horizon) (n + s) while > 0.

    w = -v . n is the speed towards it, n its normal, g the gap less the margin. The first term is
    the least constant acceleration that stops w within g; without other forces w falls to 0 before
    the margin is reached. s, along the surface, keeps the speed: the way bends instead of stopping.
    All solids of the scene count, whether they collide or not.
    """

    margin: Number = quantity(0.5, "m", above=0)
    """Gap that is left."""

    horizon: Number = quantity(2.0, "s", above=0)
    """Time before an impact at which it begins to turn."""

    needs = ("obstacle",)

    @kernel
    def acceleration(p, q, t):
        gap, nx, ny, nz = q.obstacle
        closing = max(-(q.vx * nx + q.vy * ny + q.vz * nz), 0.0)
        least = 0.01 * p.margin
        room = max(gap - p.margin, least)
        early = 1.0 / p.horizon if gap - p.margin > least else 0.0
        need = 0.5 * closing * max(closing / room - early, 0.0)
        # Along the surface; head on, where that has no direction, to one side.
        sx = q.vx + closing * (nx - 0.05 * ny)
        sy = q.vy + closing * (ny + 0.05 * nx)
        sz = q.vz + closing * nz
        s = sqrt(sx * sx + sy * sy + sz * sz + 1e-20)
        bend = min(closing / s, 1.0) / s
        return need * (nx + bend * sx), need * (ny + bend * sy), need * (nz + bend * sz)
