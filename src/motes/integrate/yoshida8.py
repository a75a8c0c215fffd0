"""Yoshida's eighth-order composition of fifteen leapfrogs (solution D): orbits to the last digits.

H. Yoshida, Construction of higher order symplectic integrators, Physics Letters A 150 (1990)
262-268, table 2; the last digits from Newton's method on the order conditions.
"""

from motes.tableau import composed

method = composed(
    8,
    (
        1.0424262086997043,
        1.82020630970698,
        0.15773992812370832,
        2.440027326166344,
        -0.007169894197095332,
        -2.446991823704246,
        -1.6158237415006538,
    ),
)
