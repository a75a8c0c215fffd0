"""The Rosenbrock method RODAS: fourth order, stiff problems without any iteration.

With fixed steps, as in a scene, stiff forces must be nearly linear (drag, a spring); where stiff
ones bend, as in a net of springs, radau5 and kencarp4 hold. L-stable, with an embedded method of
order 3. Coefficients: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.7,
and their program rodas.f (METH = 1).
"""

from motes.tableau import Rosenbrock

# fmt: off
A5 = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950)

method = Rosenbrock(
    order=4,
    gamma=1 / 4,
    c=(0, 0.386, 0.21, 0.63, 1, 1),
    g=(0.25, -0.1043, 0.1035, -0.0362, 0, 0),
    a=(
        (),
        (1.544,),
        (0.9466785280815826, 0.2557011698983284),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817),
        A5,
        (*A5, 1),
    ),
    d=(
        (),
        (-5.6688,),
        (-2.430093356833875, -0.2063599157091915),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
        (8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136,
         -6.058818238834054),
    ),
    b=(*A5, 1, 1),
    b_low=(*A5, 1, 0),
    low_order=3,
)
# fmt: on
