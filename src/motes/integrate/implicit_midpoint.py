"""The implicit midpoint rule: second order, symplectic, keeps circles for ever."""

from motes.tableau import Implicit

method = Implicit(order=2, c=(1 / 2,), a=((1 / 2,),), b=(1,))
