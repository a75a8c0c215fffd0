"""A pendulum from almost upright: closed curves in the plane of angle and speed."""

import numpy as np

from motes.problem import Problem

problem = Problem(
    acceleration=lambda t, x, v: -np.sin(x),
    start=(2.8, 0.0),
    span=(0.0, 25.0),
    step=0.2,
    methods=("euler", "semi_implicit_euler", "leapfrog", "rk4", "implicit_midpoint"),
    labels=("angle", "speed"),
    energy=lambda y: y[:, 1] ** 2 / 2 - np.cos(y[:, 0]),
)
