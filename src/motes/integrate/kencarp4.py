"""Kennedy and Carpenter's fourth-order method (the implicit half): stiff problems, with estimate.

L-stable. C. A. Kennedy and M. H. Carpenter, Additive Runge-Kutta schemes for convection-diffusion-
reaction equations, Applied Numerical Mathematics 44 (2003) 139-181, ARK4(3)6L[2]SA.
"""

from motes.tableau import Implicit

B = (82889 / 524892, 0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4)

method = Implicit(
    order=4,
    c=(0, 1 / 2, 83 / 250, 31 / 50, 17 / 20, 1),
    a=(
        (0, 0, 0, 0, 0, 0),
        (1 / 4, 1 / 4, 0, 0, 0, 0),
        (8611 / 62500, -1743 / 31250, 1 / 4, 0, 0, 0),
        (5012029 / 34652500, -654441 / 2922500, 174375 / 388108, 1 / 4, 0, 0),
        (
            15267082809 / 155376265600,
            -71443401 / 120774400,
            730878875 / 902184768,
            2285395 / 8070912,
            1 / 4,
            0,
        ),
        B,
    ),
    b=B,
    b_low=(
        4586570599 / 29645900160,
        0,
        178811875 / 945068544,
        814220225 / 1159782912,
        -3700637 / 11593932,
        61727 / 225920,
    ),
    low_order=3,
)
