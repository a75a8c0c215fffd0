"""Backward Euler: first order, damps every decay at any step. The sturdiest implicit method."""

from motes.tableau import Implicit

method = Implicit(order=1, c=(1,), a=((1,),), b=(1,))
