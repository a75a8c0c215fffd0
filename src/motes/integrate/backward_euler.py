"""Backward Euler: first order, damps every decay at any step. The sturdiest implicit method.

The error estimate compares it with the trapezoid, whose first stage is the slope at the start.

Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.3.
"""

from motes.tableau import Implicit

method = Implicit(
    order=1, c=(0, 1), a=((0, 0), (0, 1)), b=(0, 1), b_low=(1 / 2, 1 / 2), low_order=2
)
