"""Accelerations of one particle: forces, each a formula in a file.

A force defines `acceleration(p, q, t)`, which gives ax, ay, az in m/s2, and `potential(p, q, t)`
in J/kg where one exists; or, for forces that pull the velocity to a value, `relaxation(p, q, t)`,
which gives the rate k [1/s] and that velocity u [m/s]: a = -k (v - u). Splitting methods integrate
a relaxation exactly, so that no step makes it explode; Runge-Kutta methods use it as a force.

A limit defines `limited(p, q, t, ax, ay, az)`: what the body can do of the sum of all
accelerations, those of laws between particles too. A force that needs "obstacle" reads the solids
of the scene: `q.obstacle` is the gap to the nearest one [m] and its normal, (gap, nx, ny, nz).
"""

from __future__ import annotations

from motes.catalog import Flag, Kind, attribute, quantity


class _Common:
    stiff: Flag = quantity(False)
    """Whether integrators in two parts (kencarp3, kencarp4) take it implicitly, and forces without
    this mark explicitly. Where no force has the mark they take all implicitly."""


KIND = Kind("force", "force", "particle", ("acceleration", "relaxation", "limited"), _Common)
__getattr__ = attribute("force")
