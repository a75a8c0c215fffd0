"""The implicit trapezoid (Crank and Nicolson): second order, A-stable; rings on stiff decays.

The error estimate is Simpson's rule, third order, on the cubic through both ends of the step; its
stage costs nothing where steps are fixed.

J. Crank and P. Nicolson, Proceedings of the Cambridge Philosophical Society 43 (1947) 50-67.
"""

from motes.tableau import Implicit

method = Implicit(
    order=2,
    c=(0, 1, 1 / 2),
    a=((0, 0, 0), (1 / 2, 1 / 2, 0), (3 / 8, 1 / 8, 0)),
    b=(1 / 2, 1 / 2, 0),
    b_low=(1 / 6, 1 / 6, 2 / 3),
    low_order=3,
)
