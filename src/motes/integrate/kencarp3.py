"""Kennedy and Carpenter's third-order method: four stages, for a stiff part of moderate tolerance.

L-stable. With `stiff=g`, y' = f + g: g is taken implicitly, f explicitly (an additive pair); in a
scene, forces with `stiff = true` are g. C. A. Kennedy and M. H. Carpenter, Additive Runge-Kutta
schemes for convection-diffusion-reaction equations, Applied Numerical Mathematics 44 (2003)
139-181, ARK3(2)4L[2]SA.
"""

from motes.tableau import Implicit

G = 1767732205903 / 4055673282236
B = (
    1471266399579 / 7840856788654,
    -4482444167858 / 7529755066697,
    11266239266428 / 11593286722821,
    G,
)

method = Implicit(
    order=3,
    c=(0, 1767732205903 / 2027836641118, 3 / 5, 1),
    a=(
        (0, 0, 0, 0),
        (G, G, 0, 0),
        (2746238789719 / 10658868560708, -640167445237 / 6845629431997, G, 0),
        B,
    ),
    b=B,
    b_low=(
        2756255671327 / 12835298489170,
        -10771552573575 / 22201958757719,
        9247589265047 / 10645013368117,
        2193209047091 / 5459859503100,
    ),
    low_order=2,
    a_explicit=(
        (),
        (1767732205903 / 2027836641118,),
        (5535828885825 / 10492691773637, 788022342437 / 10882634858940),
        (
            6485989280629 / 16251701735622,
            -4246266847089 / 9704473918619,
            10755448449292 / 10357097424841,
        ),
    ),
)
