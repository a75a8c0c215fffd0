"""Leapfrog as drift, kick, drift (position Verlet): second order with one evaluation a step.

For forces that are known at the middle of a step. Hairer, Lubich and Wanner, Geometric Numerical
Integration, section I.1.
"""

from motes.tableau import Splitting

method = Splitting(order=2, kicks=(0, 1, 0), drifts=(1 / 2, 1 / 2))
