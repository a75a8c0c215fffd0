"""The same step in Warp, whose kernels run on one thread of the CPU."""

import numpy as np
import warp as wp
from _report import best

wp.config.quiet = True

STEP, RATE, CORE, STRENGTH = (wp.constant(wp.float32(v)) for v in (1e-3, 0.1, 0.1, 2.0))


@wp.func
def acceleration(x: wp.vec3, v: wp.vec3):
    k = STRENGTH / (x[0] * x[0] + x[1] * x[1] + CORE * CORE)
    return wp.vec3(-k * x[1], k * x[0], -9.81) - RATE * v


@wp.kernel
def step(position: wp.array(dtype=wp.vec3), velocity: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    h = STEP
    x = position[i]
    v = velocity[i]
    a1 = acceleration(x, v)
    v2 = v + h / 2.0 * a1
    a2 = acceleration(x + h / 2.0 * v, v2)
    v3 = v + h / 2.0 * a2
    a3 = acceleration(x + h / 2.0 * v2, v3)
    v4 = v + h * a3
    a4 = acceleration(x + h * v3, v4)
    position[i] = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    velocity[i] = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


def speed(n: int, threads: int) -> float:
    """Millions of particle-steps per second; `threads` cannot be heeded."""
    wp.init()
    start = np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32)
    with wp.ScopedDevice("cpu"):
        position = wp.array(start, dtype=wp.vec3)
        velocity = wp.zeros(n, dtype=wp.vec3)
        return n / best(lambda: wp.launch(step, dim=n, inputs=[position, velocity]), 4) / 1e6
