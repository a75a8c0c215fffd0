"""Nystrom's fifth-order method for x'' = a(t, x): four evaluations a step.

For forces that follow from place and time alone: scenes with drag, wind or flows refuse it.

E. J. Nystrom, 1925; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table
II.14.2.
"""

from motes.tableau import Nystrom

method = Nystrom(
    order=5,
    c=(0, 1 / 5, 2 / 3, 1),
    a=((), (1 / 50,), (-1 / 27, 7 / 27), (3 / 10, -2 / 35, 9 / 35)),
    b=(14 / 336, 125 / 336, 162 / 336, 35 / 336),
    b_position=(14 / 336, 100 / 336, 54 / 336, 0),
)
