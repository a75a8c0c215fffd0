"""What a body can do by itself: limits of speed, turn and thrust."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel, sqrt


@component
class Agility:
    """Limits what the accelerations on a body may do together, as muscles and wings do.

    Along its way: at most (top_speed - |v|) / response, at least (least_speed - |v|) / response.
    Across it: a turn of at most `turn`, |a| <= turn |v|. In all: |a| <= thrust. Drag and wind,
    which act from outside, come on top. After the truncations of Reynolds (1999), but as a law of
    continuous time, so that a finer step changes nothing.
    """

    least_speed: Number = quantity(0.0, "m/s", at_least=0)
    """Slowest; a bird that stops falls."""

    top_speed: Number = quantity(10.0, "m/s", above=0)
    """Fastest."""

    turn: Number = quantity(360.0, "degrees/s", at_least=0)
    """Fastest change of direction."""

    thrust: Number = quantity(50.0, "m/s2", at_least=0)
    """Greatest acceleration."""

    response: Number = quantity(0.2, "s", above=0)
    """Time in which the speed keeps to its limits; a step must not be longer."""

    @kernel
    def limited(p, q, t, ax, ay, az):
        v = sqrt(q.vx * q.vx + q.vy * q.vy + q.vz * q.vz + 1e-20)
        dx, dy, dz = q.vx / v, q.vy / v, q.vz / v
        along = ax * dx + ay * dy + az * dz
        ax, ay, az = ax - along * dx, ay - along * dy, az - along * dz
        across = sqrt(ax * ax + ay * ay + az * az + 1e-20)
        side = min(1.0, 0.017453292519943295 * p.turn * max(v, p.least_speed) / across)
        along = min(along, (p.top_speed - v) / p.response)
        along = max(along, (p.least_speed - v) / p.response)
        ax, ay, az = side * ax + along * dx, side * ay + along * dy, side * az + along * dz
        scale = min(1.0, p.thrust / sqrt(ax * ax + ay * ay + az * az + 1e-20))
        return scale * ax, scale * ay, scale * az
