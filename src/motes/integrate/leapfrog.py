"""Leapfrog as kick, drift, kick (velocity Verlet): second order, keeps the energy of orbits."""

from motes.tableau import Splitting

method = Splitting(order=2, kicks=(1 / 2, 1 / 2), drifts=(1,))
