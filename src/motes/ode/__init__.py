"""Ordinary differential equations: one door to every method, compiled or not.

from motes import ode
r = ode.solve(f, y0, (t0, t1), method="dop853", rtol=1e-9)
r.t, r.y, r(t)
"""

from __future__ import annotations

from motes.ode.jacobian import Newton
from motes.ode.solution import Crossings, Event, NewtonSolution, Solution, Work
from motes.ode.solve import solve
from motes.ode.solve_many import ManySolutions, solve_many
from motes.ode.solve_newton import solve_newton
from motes.ode.stability import MethodFacts, methods

__all__ = [
    "Crossings",
    "Event",
    "ManySolutions",
    "MethodFacts",
    "Newton",
    "NewtonSolution",
    "Solution",
    "Work",
    "methods",
    "solve",
    "solve_many",
    "solve_newton",
]
