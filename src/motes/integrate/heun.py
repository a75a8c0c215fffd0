"""Heun's method, the explicit trapezoid: second order with two evaluations.

For loose tolerances and a first look. K. Heun, 1900; Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I, section II.1.
"""

from motes.tableau import Explicit

method = Explicit(order=2, c=(0, 1), a=((), (1,)), b=(1 / 2, 1 / 2))
