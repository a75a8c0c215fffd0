"""Wind with gusts."""

from motes.catalog import Number, Vector, component, quantity
from motes.kernel import kernel
from motes.noise import noise


@component
class Wind:
    """Air that carries particles along: a = -(grip / mass) (v - u),
    u = velocity (1 + gusts n).

    n(x, t) is smooth noise of mean 0 and rms 1 that drifts with the wind.
    """

    velocity: Vector = quantity((1.0, 0.0, 0.0), "m/s")
    """Mean velocity of the air."""

    grip: Number = quantity(1.0, "kg/s", at_least=0)
    """Force per speed relative to the air."""

    gusts: Number = quantity(0.0, "", at_least=0)
    """Strength of the gusts, as a share of the velocity."""

    size: Number = quantity(2.0, "m", above=0)
    """Size of a gust."""

    seed: Number = quantity(0, "", at_least=0, at_most=1e6, scope="scene")
    """Another number gives other gusts."""

    needs = ("mass",)

    @kernel
    def relaxation(p, q, t):
        scale = 1.0 / p.size
        x = (q.x - p.velocity[0] * t) * scale
        y = (q.y - p.velocity[1] * t) * scale
        z = (q.z - p.velocity[2] * t) * scale
        n, _, _, _ = noise(x, y, z, 0.3 * t, p.seed)
        gust = 1.0 + p.gusts * n
        k = p.grip / q.mass
        return k, p.velocity[0] * gust, p.velocity[1] * gust, p.velocity[2] * gust
