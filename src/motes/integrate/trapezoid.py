"""The implicit trapezoid (Crank and Nicolson): second order, A-stable; rings on stiff decays."""

from motes.tableau import Implicit

method = Implicit(order=2, c=(0, 1), a=((0, 0), (1 / 2, 1 / 2)), b=(1 / 2, 1 / 2))
