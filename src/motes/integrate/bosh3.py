"""Bogacki and Shampine's third-order method with error estimate: loose tolerances.

P. Bogacki and L. F. Shampine, A 3(2) pair of Runge-Kutta formulas, Applied Mathematics Letters 2
(1989) 321-325.
"""

from motes.tableau import Explicit

method = Explicit(
    order=3,
    c=(0, 1 / 2, 3 / 4, 1),
    a=((), (1 / 2,), (0, 3 / 4), (2 / 9, 1 / 3, 4 / 9)),
    b=(2 / 9, 1 / 3, 4 / 9, 0),
    b_low=(7 / 24, 1 / 4, 1 / 3, 1 / 8),
    low_order=2,
)
