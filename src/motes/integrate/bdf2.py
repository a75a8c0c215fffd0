"""The second backward differentiation formula: stiff problems with one solve a step.

Backward Euler makes the first step; in a scene, the first after every birth and impact as well.
Hairer and Wanner, Solving Ordinary Differential Equations II, section V.1.
"""

from motes.tableau import BackwardDifference

method = BackwardDifference(order=2, a=(3 / 2, -2, 1 / 2))
