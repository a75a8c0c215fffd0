"""The second backward differentiation formula: stiff problems with one solve a step.

Backward Euler makes the first step. In a scene sdirk2 takes particles through steps in which they
are born or bounce, and backward Euler makes the first one after. Hairer and Wanner, Solving
Ordinary Differential Equations II, section V.1.
"""

from motes.tableau import BackwardDifference

method = BackwardDifference(order=2, a=(3 / 2, -2, 1 / 2))
