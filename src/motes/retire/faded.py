"""Death of particles that nobody sees any more."""

from motes.catalog import Number, component, quantity
from motes.kernel import kernel


@component
class Faded:
    """Dies when its colour times its alpha is darker than a threshold, once it has been brighter.

    The brightness is alpha max(red, green, blue) (Reeves 1983: particles below an intensity die).
    """

    below: Number = quantity(0.01, "", at_least=0)
    """Brightness under which a particle dies."""

    after: Number = quantity(0.05, "s", at_least=0)
    """Age before which none dies, so that a colour may fade in."""

    needs = ("color", "age")

    @kernel
    def dies(p, q, t):
        bright = q.color[3] * max(q.color[0], max(q.color[1], q.color[2]))
        return (bright < p.below) & (q.age > p.after)
