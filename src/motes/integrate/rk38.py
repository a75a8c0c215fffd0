"""Kutta's 3/8 rule: fourth order, error constants a little smaller than the classical method's.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table II.1.2.
"""

from motes.tableau import Explicit

method = Explicit(
    order=4,
    c=(0, 1 / 3, 2 / 3, 1),
    a=((), (1 / 3,), (-1 / 3, 1), (1, -1, 1)),
    b=(1 / 8, 3 / 8, 3 / 8, 1 / 8),
)
