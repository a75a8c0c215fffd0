"""Velocities that carry a particle: x' = v + the sum of flows.

A flow defines `velocity(p, q, t)`, which gives ux, uy, uz in m/s. A system with flows and no forces
has no velocity of its own.
"""

from __future__ import annotations

from motes.catalog import Kind, attribute

KIND = Kind("flow", "flow", "particle", ("velocity",))
__getattr__ = attribute("flow")
