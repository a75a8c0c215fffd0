"""Gravity as its definition says: a double loop, in double precision."""

import math
import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from motes import gravity


def spline_factors(r, h):
    """s and w of a mass spread as a cubic spline of support h, from its enclosed mass.

    Density (8 / pi h^3) times 2 (1 - u)^3 - 8 (1/2 - u)^3, each term where it is positive: mass and
    depth by Gauss-Legendre quadrature, exact for these polynomials.
    """

    def density(q):
        u = q / h
        return 8 / (math.pi * h**3) * (2 * max(1 - u, 0) ** 3 - 8 * max(0.5 - u, 0) ** 3)

    def integral(f, low, high):
        cuts = sorted({low, high, *(c for c in (h / 2, h) if low < c < high)})
        nodes, weights = np.polynomial.legendre.leggauss(8)
        return sum(
            (b - a)
            / 2
            * sum(w * f((b - a) / 2 * x + (a + b) / 2) for x, w in zip(nodes, weights, strict=True))
            for a, b in pairwise(cuts)
        )

    inside = integral(lambda q: 4 * math.pi * q * q * density(q), 0.0, min(r, h))
    outside = integral(lambda q: 4 * math.pi * q * density(q), r, h) if r < h else 0.0
    return inside / r**3, inside / r + outside


def factors(r, softening, kernel):
    if not softening:
        return (1 / r**3, 1 / r) if r else (0.0, 0.0)
    if kernel == "plummer":
        d = math.sqrt(r * r + softening * softening)
        return 1 / d**3, 1 / d
    return spline_factors(max(r, 1e-9 * softening), 2.8 * softening)


def field(x, m, G=1.0, softening=0.0, kernel="spline", targets=None):
    """Accelerations and potentials by two loops."""
    points = x if targets is None else targets
    a, phi = np.zeros((len(points), 3)), np.zeros(len(points))
    for i, y in enumerate(points):
        for j in range(len(x)):
            if targets is None and i == j:
                continue
            d = x[j].astype(float) - y.astype(float)
            s, w = factors(math.sqrt(float(d @ d)), softening, kernel)
            a[i] += G * m[j] * s * d
            phi[i] -= G * m[j] * w
    return a, phi


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize(
    ("softening", "kernel"), [(0.0, "spline"), (0.3, "spline"), (0.3, "plummer")]
)
def test_direct_sums_are_the_double_loop(real, apart, softening, kernel):
    """Rounding: some units in the last place of each of 61 terms."""
    rng = np.random.default_rng(0)
    x, m = rng.random((61, 3)).astype(real), rng.random(61)
    targets = rng.random((7, 3)).astype(real) if apart else None
    options = {"softening": softening, "softening_kernel": kernel, "targets": targets}
    a, phi = gravity.field(x, m, G=2.0, **options)
    plain_a, plain_phi = field(x, m, 2.0, softening, kernel, targets)
    assert a.dtype == phi.dtype == real
    tolerance = 16 * np.finfo(real).eps
    assert np.abs(a - plain_a).max() < tolerance * np.abs(plain_a).max()
    assert np.abs(phi - plain_phi).max() < tolerance * np.abs(plain_phi).max()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 17])
def test_every_number_of_particles_is_summed(count):
    rng = np.random.default_rng(count)
    x, m = rng.normal(size=(count, 3)), rng.random(count)
    plain_a, plain_phi = field(x, m)
    for options in ({}, {"tolerance": 1e-8, "method": "multipole"}):
        a, phi = gravity.field(x, m, **options)
        np.testing.assert_allclose(a, plain_a, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(phi, plain_phi, rtol=1e-12, atol=1e-13)


PROGRAM = """
import numpy as np
from motes import gravity

rng = np.random.default_rng(0)
x, m = rng.normal(size=(150, 3)), rng.random(150)
for kernel in ("spline", "plummer"):
    law = {"softening": 0.05, "softening_kernel": kernel}
    exact = gravity.acceleration(x, m, **law)
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        a = gravity.acceleration(x, m, tolerance=tolerance, method="multipole", **law)
        assert ((a - exact) ** 2).sum() < tolerance**2 * (exact**2).sum(), (kernel, tolerance)
"""


def test_plain_python_runs_the_multipole_method_as_machine_code_does():
    """All its precisions, without a compiler, and without a warning."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONWARNINGS": "error"}
    run = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
