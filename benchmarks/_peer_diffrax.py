"""Pleiades and Lorenz in diffrax, double precision, compiled before the clock runs."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from _report import best

jax.config.update("jax_enable_x64", True)


def pleiades(start: np.ndarray, tolerance: float) -> float:
    """Seconds for one solve to t = 3 with Dopri8."""
    mass = jnp.arange(1.0, 8.0)

    def f(t, s, _):
        p = s[:14].reshape(2, 7)
        d = p[:, None, :] - p[:, :, None]
        r3 = ((d**2).sum(0) + jnp.eye(7)) ** 1.5
        return jnp.concatenate([s[14:], (mass * d / r3).sum(-1).reshape(-1)])

    term = diffrax.ODETerm(f)
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    @jax.jit
    def solve(s):
        return diffrax.diffeqsolve(
            term, diffrax.Dopri8(), 0.0, 3.0, None, s,
            stepsize_controller=control, max_steps=10_000,
        ).ys  # fmt: skip

    s = jnp.asarray(start)
    return best(lambda: solve(s).block_until_ready(), 10)


def lorenz(starts: np.ndarray, end: float, tolerance: float) -> float:
    """Seconds for all systems, side by side, with Tsit5."""

    def f(t, y, rho):
        return jnp.stack(
            [10 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]
        )

    term = diffrax.ODETerm(f)
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance)

    @jax.jit
    @jax.vmap
    def solve(y):
        return diffrax.diffeqsolve(
            term, diffrax.Tsit5(), 0.0, end, None, y, args=28.0,
            stepsize_controller=control, max_steps=100_000,
        ).ys  # fmt: skip

    y = jnp.asarray(starts)
    return best(lambda: solve(y).block_until_ready(), 1)
