"""Yoshida's fourth-order composition of three leapfrogs: orbits for a long time.

H. Yoshida, Construction of higher order symplectic integrators, Physics Letters A 150 (1990)
262-268, eq. 2.12.
"""

from motes.tableau import composed

method = composed(4, (1 / (2 - 2 ** (1 / 3)),))
