"""The implicit midpoint rule: second order, symplectic, keeps circles for ever.

The error estimate is Simpson's rule, third order, on the cubic through both ends of the step; its
stages cost nothing where steps are fixed.

Hairer, Lubich and Wanner, Geometric Numerical Integration, section II.1.
"""

from motes.tableau import Implicit

method = Implicit(
    order=2,
    c=(0, 1 / 2, 1, 1 / 2),
    a=((0, 0, 0, 0), (0, 1 / 2, 0, 0), (0, 1, 0, 0), (1 / 8, 1 / 2, -1 / 8, 0)),
    b=(0, 1, 0, 0),
    b_low=(1 / 6, 0, 1 / 6, 2 / 3),
    low_order=3,
)
