"""Ralston's method: the second order with the smallest error bound.

A. Ralston, Runge-Kutta methods with minimum error bounds, Math. Comp. 16 (1962) 431-437.
"""

from motes.tableau import Explicit

method = Explicit(order=2, c=(0, 2 / 3), a=((), (2 / 3,)), b=(1 / 4, 3 / 4))
