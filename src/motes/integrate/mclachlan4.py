"""McLachlan's fourth-order method for x'' = a(x): four evaluations, very small errors.

R. I. McLachlan, On the numerical integration of ordinary differential equations by symmetric
composition methods, SIAM Journal on Scientific Computing 16 (1995) 151-168.
"""

from math import sqrt

from motes.tableau import Splitting

FIRST = 6 / 11
OUTER = (642 + sqrt(471)) / 3924
INNER = 121 * (12 - sqrt(471)) / 3924

method = Splitting(
    order=4,
    kicks=(0, FIRST, 1 / 2 - FIRST, 1 / 2 - FIRST, FIRST, 0),
    drifts=(OUTER, INNER, 1 - 2 * (OUTER + INNER), INNER, OUTER),
)
