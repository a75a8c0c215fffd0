"""Euler's method: first order, and outward on every circle. To see what a step size does."""

from motes.tableau import Explicit

method = Explicit(order=1, c=(0,), a=((),), b=(1,))
