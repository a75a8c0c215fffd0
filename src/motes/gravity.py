"""Gravity of n bodies without a scene: accelerations and potentials of points that pull.

    from motes import gravity
    a = gravity.acceleration(x, m, softening=0.05)           # all pairs
    a = gravity.acceleration(x, m, tolerance=1e-3)           # fast multipole method, O(n)

Particle i is pulled by all j with a_i = G sum_j m_j (x_j - x_i) / r^3 and has the potential
phi_i = -G sum_j m_j / r, r = |x_j - x_i|, weakened at short range by a softening. Points at one
place do not pull each other, and no particle counts itself.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motes.errors import likely
from motes.interact.gravity.direct import direct
from motes.interact.gravity.multipole import Units, multipole
from motes.interact.gravity.plan import MIXED_FROM, SINGLE_FROM
from motes.interact.gravity.softening import SUPPORT, center_depth
from motes.interact.gravity.survey import of_columns
from motes.interact.gravity.tree import Box
from motes.interact.gravity.trees import Trees

__all__ = ["Trees", "acceleration", "field", "potential"]

METHODS = ("auto", "direct", "multipole")
SOFTENINGS = ("spline", "plummer")

TIGHTEST = {"single": 1e-6, "double": 1e-10}
"""Smallest tolerance by the precision of the positions."""

WIDER = '; give x as float64, in a scene precision = "double".'
"""Remedy for a tolerance that only doubles can keep."""

FARTHEST = 1e150
"""Edge of the largest cube around positions, whose square is still a number."""


def acceleration(
    x: ArrayLike,
    m: ArrayLike,
    *,
    G: float = 1.0,
    softening: float = 0.0,
    softening_kernel: str = "spline",
    tolerance: float | None = None,
    method: str = "auto",
    targets: ArrayLike | None = None,
    trees: Trees | None = None,
) -> NDArray[Any]:
    """Accelerations a_i = G sum_j m_j s(r) (x_j - x_i), s = 1 / r^3 where there is no softening.

    Parameters
    ----------
    x: positions (n, 3), float32 or float64, which is the precision of direct sums and of results.
    m: masses (n,), at least 0.
    G: gravitational constant, in the units of the rest.
    softening: length h. With "spline", gravity is that of a cubic spline of support 2.8 h, exactly
        Newton's beyond (Springel, Yoshida and White 2001, equation A1); with "plummer",
        s = (r^2 + h^2)^(-3/2).
    softening_kernel: "spline" or "plummer".
    tolerance: largest rms error in units of the rms acceleration, below 1 and at least 1e-10
        (1e-6 for float32); None for direct sums.
    method: "direct", "multipole", or "auto": the faster one that keeps the tolerance.
    targets: other points (k, 3) at which to find the acceleration.
    trees: `Trees()` that sums over the same particles, one after another, are given to use again
        while these move little; without, a sum depends on nothing else.

    Returns (n, 3) or (k, 3). Raises ValueError for wrong shapes or values.

    Source of the multipole method: Dehnen, Computational Astrophysics and Cosmology 1 (2014) 1.
    """
    problem = _Problem(x, m, G, softening, softening_kernel, tolerance, method, targets)
    return problem.fields(False, trees)[0]


def potential(
    x: ArrayLike,
    m: ArrayLike,
    *,
    G: float = 1.0,
    softening: float = 0.0,
    softening_kernel: str = "spline",
    tolerance: float | None = None,
    method: str = "auto",
    targets: ArrayLike | None = None,
    trees: Trees | None = None,
) -> NDArray[Any]:
    """Potentials phi_i = -G sum_j m_j w(r), j not i, w = 1 / r where there is no softening.

    Parameters and errors are those of `acceleration`; the tolerance holds for both. Returns (n,) or
    (k,). The energy of all is half the sum of m phi. Coincident particles count only if softened.
    """
    problem = _Problem(x, m, G, softening, softening_kernel, tolerance, method, targets)
    return problem.fields(True, trees)[1]


def field(
    x: ArrayLike,
    m: ArrayLike,
    *,
    G: float = 1.0,
    softening: float = 0.0,
    softening_kernel: str = "spline",
    tolerance: float | None = None,
    method: str = "auto",
    targets: ArrayLike | None = None,
    trees: Trees | None = None,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Accelerations and potentials together, as `acceleration` and `potential` give them."""
    problem = _Problem(x, m, G, softening, softening_kernel, tolerance, method, targets)
    return problem.fields(True, trees)


class _Problem:
    """Checked input, in units in which single precision neither over- nor underflows."""

    def __init__(
        self,
        x: ArrayLike,
        m: ArrayLike,
        G: float,
        softening: float,
        kernel: str,
        tolerance: float | None,
        method: str,
        targets: ArrayLike | None,
    ) -> None:
        position, *corners = _points(x, "x")
        points = position
        if targets is not None:
            points, low, high = _points(targets, "targets")
            corners = [np.minimum(low, corners[0]), np.maximum(high, corners[1])]
        self.mass, self.total = _masses(m, len(position))
        self.dtype = position.dtype
        self.G = _number(G, "G")
        softening = _number(softening, "softening", at_least=0.0)
        self.method = _choice(method, METHODS, "method")
        kernel = _choice(kernel, SOFTENINGS, "softening_kernel")
        self.tolerance = _tolerance(tolerance, self.method, self.dtype)
        self.apart = targets is not None

        self.low, high = corners
        with np.errstate(over="ignore"):
            size = float((high - self.low).max()) if len(position) or len(points) else 0.0
        if not size < FARTHEST:
            raise ValueError(f"x spans {size:g}; it must be below {FARTHEST:g}: use other units.")
        self.length = _power_of_two(size)
        self.cube = size or 1.0
        # Equal masses are then powers of two, which single precision holds to the last bit.
        count = max(len(position), 1)
        self.unit_mass = self.total * (_power_of_two(count) / count)
        self.position, self.points = position, points
        self.law = kernel if softening > 0.0 else "newton"
        self.size = softening * (SUPPORT if kernel == "spline" else 1.0) / self.length

    def fields(
        self, potential: bool, trees: Trees | None = None
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Accelerations (k, 3), and with `potential` potentials (k,) without what each particle
        adds to itself, in the caller's units."""
        if not len(self.points) or not self.total:
            return np.zeros((len(self.points), 3), self.dtype), np.zeros(
                len(self.points), self.dtype
            )
        per_length = self.G * self.unit_mass / self.length
        own = 0.0 if self.apart else center_depth(self.law, self.size)
        units = Units(per_length / self.length, -per_length, own)
        if self.tolerance is None or self._few():
            return self._direct(potential, units)
        targets = self.points if self.apart else None
        box = Box(self.low, self.cube, self.length, self.unit_mass)
        kind = self.law, self.size, self.tolerance, potential
        found = multipole(self.position, self.mass, targets, box, *kind, units, trees)
        if not np.isfinite(of_columns(found[0])[2]).all():
            warnings.warn("overflow: accelerations beyond float32", RuntimeWarning, stacklevel=3)
        return found

    def _direct(self, potential: bool, units: Units) -> tuple[NDArray[Any], NDArray[Any]]:
        mass = self.mass / self.unit_mass
        source = np.array([*(self.position.T / self.length), mass], self.dtype)
        target = np.array(self.points.T / self.length, self.dtype, order="C")
        sums = direct(source, target, self.law, self.size, potential)
        pull: NDArray[Any] = np.empty((sums.shape[1], 3), self.dtype)
        np.multiply(sums[:3].T, units.pull, out=pull, casting="same_kind")
        if not potential:
            return pull, pull[:0, 0]
        depth = sums[3] if self.apart else sums[3] - mass * units.own
        return pull, (depth * units.depth).astype(self.dtype)

    def _few(self) -> bool:
        """Whether direct sums are asked for, or faster."""
        if self.method == "auto" and self.tolerance is not None:
            pairs_as_dear = crossover(self.tolerance, self.dtype)
            return math.sqrt(len(self.position) * len(self.points)) < pairs_as_dear
        return self.method == "direct"


def crossover(tolerance: float, dtype: np.dtype[Any]) -> float:
    """Number of particles from which the multipole method is faster than direct sums.

    Fits to measurements on processors with AVX2 and with AVX-512, where both take as long (two
    cores, a Plummer sphere), which differ by a third: in single precision about 8 500, 14 000 and
    25 000 at 1e-3, 1e-5, 1e-6; in double precision 3 300, 4 900, 6 500, 21 000 at 1e-3, 1e-5, 1e-6,
    1e-8.
    """
    digits = max(-math.log10(tolerance), 2.0)
    single = dtype == np.float32
    if tolerance >= SINGLE_FROM:
        many, more, at = (8_500.0, 1.28, 3.0) if single else (3_300.0, 1.22, 3.0)
    elif tolerance >= MIXED_FROM:
        many, more, at = 25_000.0 if single else 6_500.0, 1.3, 6.0
    else:
        many, more, at = 21_000.0, 1.37, 8.0
    return many * math.pow(more, digits - at)


def _points(
    values: ArrayLike, name: str
) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64]]:
    """Points (n, 3), and the smallest and largest coordinates (3,) of all."""
    points = np.asarray(values)
    if points.dtype != np.float32:
        casting: Any = "same_kind" if points.size else "unsafe"
        try:
            points = points.astype(np.float64, casting=casting, copy=False)
        except TypeError:
            raise ValueError(f"{name} must be real numbers, not {points.dtype}.") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError(f"{name} must have the shape (n, 3), not {points.shape}.")
    low, high, sums = of_columns(points)
    _check_finite(points, sums, name)
    return points, low, high


def _masses(values: ArrayLike, count: int) -> tuple[NDArray[np.float64], float]:
    """Masses (n,) and their sum."""
    mass = np.asarray(values, np.float64)
    if mass.shape != (count,):
        raise ValueError(
            f"m must have the shape ({count},), one mass per row of x, not {mass.shape}."
        )
    low, _, total = of_columns(mass[:, None])
    _check_finite(mass, total, "m")
    if low[0] < 0:
        i = int(np.argmax(mass < 0))
        raise ValueError(f"m[{i}] = {mass[i]:g}; masses must be at least 0.")
    return mass, float(total[0])


def _check_finite(values: NDArray[Any], sums: NDArray[np.float64], name: str) -> None:
    """Sums that are finite are those of finite values."""
    if not np.isfinite(sums).all() and not np.isfinite(values).all():
        i = tuple(int(k) for k in np.argwhere(~np.isfinite(values))[0])
        place = ", ".join(str(k) for k in i)
        raise ValueError(f"{name}[{place}] = {values[i]}; all values must be finite.")


def _number(value: float, name: str, at_least: float = -math.inf) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number, not {value!r}.") from None
    if not math.isfinite(number) or number < at_least:
        bound = "" if at_least == -math.inf else f" of at least {at_least:g}"
        raise ValueError(f"{name} = {number:g} must be a finite number{bound}.")
    return number


def _choice(value: str, menu: tuple[str, ...], name: str) -> str:
    if value not in menu:
        raise ValueError(
            f"{name} {value!r} is none of {', '.join(menu)}.{likely(str(value), menu)}"
        )
    return value


def _tolerance(tolerance: float | None, method: str, dtype: np.dtype[Any]) -> float | None:
    if tolerance is None:
        if method == "multipole":
            raise ValueError('method "multipole" needs a tolerance, such as tolerance=1e-3.')
        return None
    number = _number(tolerance, "tolerance")
    precision = "single" if dtype == np.float32 else "double"
    least = TIGHTEST[precision]
    if not least <= number < 1.0:
        raise ValueError(
            f"tolerance = {number:g} must be below 1 and at least {least:g} for positions in "
            f"{precision} precision" + (WIDER if TIGHTEST["double"] <= number < least else ".")
        )
    return number


def _power_of_two(value: float) -> float:
    return 2.0 ** math.frexp(value)[1] if value > 0.0 else 1.0
