"""The three-stage Radau IIA method: fifth order, L-stable, the standard for stiff problems.

Hairer and Wanner, Solving Ordinary Differential Equations II, table IV.5.6; its estimate, eq.
IV.8.19, is written with f(y0) as an explicit first stage.
"""

from math import sqrt

from motes.tableau import Implicit

S = sqrt(6)
A = (
    ((88 - 7 * S) / 360, (296 - 169 * S) / 1800, (-2 + 3 * S) / 225),
    ((296 + 169 * S) / 1800, (88 + 7 * S) / 360, (-2 - 3 * S) / 225),
    ((16 - S) / 36, (16 + S) / 36, 1 / 9),
)
GAMMA = 1 / (3 + 3 ** (2 / 3) - 3 ** (1 / 3))
"""Inverse of the real eigenvalue of A's inverse."""

E = ((-13 - 7 * S) / 3, (-13 + 7 * S) / 3, -1 / 3)
ESTIMATE = tuple(GAMMA * sum(E[m] * A[m][j] for m in range(3)) for j in range(3))

method = Implicit(
    order=5,
    c=(0, (4 - S) / 10, (4 + S) / 10, 1),
    a=((0, 0, 0, 0), *((0, *row) for row in A)),
    b=(0, *A[2]),
    b_low=(GAMMA, *(b + e for b, e in zip(A[2], ESTIMATE, strict=True))),
    low_order=3,
)
