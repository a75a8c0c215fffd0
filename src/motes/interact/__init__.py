"""Laws between particles: forces that each feels from the others.

An interaction that is a global law, such as gravity, defines `accelerations(p, bodies)`: from the
positions and masses of all systems that take part, an array (3, n) [m/s2] for each of them. Systems
that share an interaction are one group and take every stage of a step together. It may define
`energy(p, bodies)`, their potential energy [J].

A law of velocities defines `velocities(p, walkers, step)`: what the particles may do of what the
forces want (`constrain.py`). A law of captures defines `captures(p, hunters, prey)`: which
particles are caught at a step's end (`capture.py`).
"""

from __future__ import annotations

from typing import Any

from motes.catalog import Kind, attribute, quantity


class _Common:
    systems: Any = quantity((), table="names")
    """Names of the systems that take part; all of them when none is named."""


KIND = Kind("interact", "interaction", "scene", ("accelerations", "velocities", "captures"), _Common)
__getattr__ = attribute("interact")
