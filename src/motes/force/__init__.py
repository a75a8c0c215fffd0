"""Accelerations of one particle: forces, each a formula in a file.

A force defines `acceleration(p, q, t)`, which gives ax, ay, az in m/s2, and `potential(p, q, t)`
in J/kg where one exists; or, for forces that pull the velocity to a value, `relaxation(p, q, t)`,
which gives the rate k [1/s] and that velocity u [m/s]: a = -k (v - u). Splitting methods integrate
a relaxation exactly, so that no step makes it explode; Runge-Kutta methods use it as a force.
"""

from __future__ import annotations

from motes.catalog import Kind, attribute

KIND = Kind("force", "force", "particle", ("acceleration", "relaxation"))
__getattr__ = attribute("force")
