"""The second backward differentiation formula: stiff problems with one solve a step.

Hairer and Wanner, Solving Ordinary Differential Equations II, section V.1. Backward Euler
makes the first step.
"""

from motes.tableau import BackwardDifference

method = BackwardDifference(order=2, a=(3 / 2, -2, 1 / 2))
