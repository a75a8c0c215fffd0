"""Semi-implicit (symplectic) Euler: kick, then drift. Cheap, and stable for drag and springs.

Hairer, Lubich and Wanner, Geometric Numerical Integration, section I.1.
"""

from motes.tableau import Splitting

method = Splitting(order=1, kicks=(1, 0), drifts=(1,))
