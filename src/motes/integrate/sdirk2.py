"""Alexander's second-order method: L-stable, two equal solves a step.

R. Alexander, Diagonally implicit Runge-Kutta methods for stiff ODEs, SIAM Journal on Numerical
Analysis 14 (1977) 1006-1021.
"""

from math import sqrt

from motes.tableau import Implicit

GAMMA = 1 - 1 / sqrt(2)

method = Implicit(
    order=2,
    c=(GAMMA, 1),
    a=((GAMMA, 0), (1 - GAMMA, GAMMA)),
    b=(1 - GAMMA, GAMMA),
    b_low=(1, 0),
)
