"""Leapfrog as kick, drift, kick (velocity Verlet): second order, keeps the energy of orbits.

Each step needs one evaluation; steps must stay fixed, or the energy drifts. L. Verlet, Physical
Review 159 (1967) 98-103; Hairer, Lubich and Wanner, Geometric Numerical Integration, section I.1.
"""

from motes.tableau import Splitting

method = Splitting(order=2, kicks=(1 / 2, 1 / 2), drifts=(1,))
