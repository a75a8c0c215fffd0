"""Following the ground at a height."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Hover:
    """Keeps a height over the nearest solid: a = ((height - g) / response - 2 v . n) n / response.

    g is the gap and n the normal: a critically damped spring to the ground, along slopes as well.
    """

    height: Number = quantity(2.0, "m", at_least=0)
    """Gap that it keeps."""

    response: Number = quantity(0.5, "s", above=0)
    """Time in which it returns to it."""

    needs = ("obstacle",)

    @kernel
    def acceleration(p, q, t):
        gap, nx, ny, nz = q.obstacle
        out = q.vx * nx + q.vy * ny + q.vz * nz
        a = ((p.height - gap) / p.response - 2.0 * out) / p.response
        return a * nx, a * ny, a * nz
