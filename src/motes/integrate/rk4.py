"""The classical Runge-Kutta method: fourth order with four evaluations. The default.

W. Kutta, 1901; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table
II.1.2.
"""

from motes.tableau import Explicit

method = Explicit(
    order=4,
    c=(0, 1 / 2, 1 / 2, 1),
    a=((), (1 / 2,), (0, 1 / 2), (0, 0, 1)),
    b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
)
