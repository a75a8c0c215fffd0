"""The explicit midpoint rule: second order with two evaluations."""

from motes.tableau import Explicit

method = Explicit(order=2, c=(0, 1 / 2), a=((), (1 / 2,)), b=(0, 1))
