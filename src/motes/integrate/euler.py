"""Euler's method: first order, and outward on every circle. To see what a step size does.

L. Euler, Institutiones calculi integralis, 1768; Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section I.7.
"""

from motes.tableau import Explicit

method = Explicit(order=1, c=(0,), a=((),), b=(1,))
