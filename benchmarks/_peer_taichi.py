"""The same step in Taichi, on its own threads."""

import numpy as np
import taichi as ti
from _report import best

STEP, RATE, CORE, STRENGTH = 1e-3, 0.1, 0.1, 2.0


@ti.func
def acceleration(x, v):
    k = STRENGTH / (x[0] * x[0] + x[1] * x[1] + CORE * CORE)
    return ti.Vector([-k * x[1], k * x[0], -9.81]) - RATE * v


@ti.kernel
def step(position: ti.template(), velocity: ti.template()):
    for i in position:
        h = ti.f32(STEP)
        x, v = position[i], velocity[i]
        a1 = acceleration(x, v)
        v2 = v + h / 2 * a1
        a2 = acceleration(x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = acceleration(x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4)
        position[i] = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        velocity[i] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def speed(n: int, threads: int) -> float:
    """Millions of particle-steps per second."""
    ti.init(arch=ti.cpu, cpu_max_num_threads=threads, fast_math=True, log_level=ti.ERROR)
    layout = ti.Layout.SOA
    position = ti.Vector.field(3, ti.f32, n, layout=layout)
    velocity = ti.Vector.field(3, ti.f32, n, layout=layout)
    position.from_numpy(np.random.default_rng(0).normal(size=(n, 3)).astype(np.float32))

    def run() -> None:
        for _ in range(10):
            step(position, velocity)
        ti.sync()

    return n * 10 / best(run, 4) / 1e6
