"""Where and how particles are born: shapes, each a file.

A shape's `birth(p, u, t, k)` turns uniform numbers `u` in [0, 1) into one newborn's position [m]
and velocity [m/s] in the emitter's own frame, in which its axis is +z. Rate, bursts, birth
instants, pose and storage are written once, in the engine.
"""

from __future__ import annotations

from motes.catalog import Kind, Number, Vector, attribute, quantity


class _Common:
    rate: Number = quantity(0.0, "1/s", at_least=0, scope="scene")
    """Births per second; the k-th happens when the integral of the rate reaches k."""

    burst: list[dict[str, float]] = quantity((), table="bursts")
    """Births all at once: [{ at = s, count = n, every = s, times = n }, ...], after the delay."""

    delay: Number = quantity(0.0, "s", at_least=0, scope="fixed")
    """Time before the first birth."""

    duration: Number = quantity(1e9, "s", at_least=0, scope="fixed")
    """How long it emits, counted from the delay."""

    position: Vector = quantity((0.0, 0.0, 0.0), "m", scope="scene")
    """Where the emitter is; a curve over time moves it, and births spread along its path."""

    direction: Vector = quantity((0.0, 0.0, 1.0), "", scope="scene")
    """Where the emitter's own axis points."""

    velocity: Vector = quantity((0.0, 0.0, 0.0), "m/s", scope="birth")
    """Added to every newborn's velocity, in the scene's frame."""

    inherit: Number = quantity(0.0, "", scope="scene")
    """Share of the emitter's own velocity that newborns get."""


KIND = Kind("emit", "emitter", "birth", ("birth",), _Common)
__getattr__ = attribute("emit")
