"""Laws between particles: forces that each feels from the others.

A pair law defines `force(p, a, b, r)` [N], the force on a from b, `reach(p)` [m], the distance up
to which it acts, and `potential(p, a, b, r)` [J] where there is one. A gathering law defines
`near(p, a, b, r)`, a tuple of numbers that is summed over all neighbours b of a within
`reach(p)`, and `acceleration(p, a, s)` [m/s2] from the sums s. Either may define `constants(p)`,
numbers by name that follow from the parameters and join p. `a` and `b` have x y z vx vy vz and the
columns that `needs` names; `r` is the way from b to a (to its nearest image): r.x r.y r.z,
r.square, r.length, and r.inverse, 1 / length, large but finite where the length is 0.

A law without a reach, such as gravity, defines `accelerations(p, bodies)`: from the positions and
masses of all systems that take part, an array (3, n) [m/s2] for each of them; it may define
`energy(p, bodies)`, their potential energy [J]. What happens at the end of a step, such as a
collision or a thermostat, defines `exchange(p, movers, when)`, which changes velocities, and
returns whether it moved anybody.

A law of velocities defines `velocities(p, walkers, step)`: what the particles may do of what the
forces want (`constrain.py`). A law of captures defines `captures(p, hunters, prey)`: which
particles are caught at a step's end (`capture.py`).

Systems that share an interaction are one group and take every stage of a step together.
"""

from __future__ import annotations

from typing import Any

from motes.catalog import Kind, Number, attribute, quantity


class _Common:
    systems: Any = quantity((), table="names")
    """Names of the systems that take part; all of them when none is named."""


class _Near(_Common):
    targets: Any = quantity((), table="names")
    """Systems that feel the law; all that take part when none is named."""

    sources: Any = quantity((), table="names")
    """Systems whose particles are felt, also such as `systems` does not name; when none is named,
    those that take part feel each other."""

    skin: Number = quantity(0.4, "", at_least=0, at_most=1, scope="scene")
    """Margin of neighbour lists as a share of the reach: wider lists are longer and last longer."""

    rebuild: int = quantity(0, at_least=0, at_most=1_000_000)
    """Steps between builds of lists; 0 builds them before a pair could be missed, others may miss
    some."""


class _Gathering(_Near):
    nearest: int = quantity(0, at_least=0, at_most=1000)
    """Only this many of the nearest neighbours within the reach count; all of them when it is 0."""


KIND = Kind(
    "interact",
    "interaction",
    "scene",
    ("accelerations", "force", "near", "exchange", "velocities", "captures"),
    _Common,
    {"force": _Near, "near": _Gathering},
)
__getattr__ = attribute("interact")
