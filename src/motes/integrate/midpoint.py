"""The explicit midpoint rule: second order with two evaluations.

C. Runge, 1895; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section II.1.
"""

from motes.tableau import Explicit

method = Explicit(order=2, c=(0, 1 / 2), a=((), (1 / 2,)), b=(0, 1))
