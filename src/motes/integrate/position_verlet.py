"""Leapfrog as drift, kick, drift (position Verlet): second order with one evaluation a step."""

from motes.tableau import Splitting

method = Splitting(order=2, kicks=(0, 1, 0), drifts=(1 / 2, 1 / 2))
