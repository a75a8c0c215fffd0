"""Motion-blurred lines."""

from motes.catalog import Number, component, quantity


@component
class Streaks:
    """Each particle drawn as the line that it covers while the shutter is open."""

    trail: Number = quantity(0.0, "s", at_least=0, at_most=100, scope="scene")
    """Time before that whose way is drawn too; the same light is spread over a longer line."""

    drawn_as = "streaks"
