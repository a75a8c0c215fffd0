"""Yoshida's sixth-order composition of seven leapfrogs (solution A).

H. Yoshida, Construction of higher order symplectic integrators, Physics Letters A 150 (1990)
262-268, table 1; more digits: Hairer, Lubich and Wanner, Geometric Numerical Integration, eq.
V.3.11.
"""

from motes.tableau import composed

method = composed(6, (0.784513610477557264, 0.235573213359358134, -1.17767998417887101))
