"""Heun's method, the explicit trapezoid: second order with two evaluations."""

from motes.tableau import Explicit

method = Explicit(order=2, c=(0, 1), a=((), (1,)), b=(1 / 2, 1 / 2))
