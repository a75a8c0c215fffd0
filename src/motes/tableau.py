"""Time-stepping methods as tables; a wrong table refuses to exist.

One table drives fused loops over independent particles, staged loops over interacting ones, and the
solvers of `motes.ode`. Families: `Explicit` and `Implicit` Runge-Kutta methods, `Rosenbrock`
methods, `Splitting` into kicks and drifts, `Nystrom` methods, and `BackwardDifference` formulas.
Every table is checked against all order conditions of its order when it is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from motes import rooted_trees
from motes.order_conditions import (
    TOLERANCE,
    TableauError,
    check,
    check_nystrom,
    check_order,
    check_sums,
)

Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class _RungeKutta:
    """What explicit and implicit Runge-Kutta methods share."""

    order: int
    c: Numbers
    a: tuple[Numbers, ...]
    b: Numbers
    b_low: Numbers | None = None
    """Weights of the embedded method, for the error estimate."""
    low_order: int = 1
    """Order of the embedded method."""

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step that stands alone."""
        return len(self.b)

    @property
    def symplectic(self) -> bool:
        """Whether b_i a_ij + b_j a_ji = b_i b_j: it keeps every quadratic invariant."""
        a = [[*row, *[0.0] * (len(self.b) - len(row))] for row in self.a]
        s, b = range(len(self.b)), self.b
        return all(
            abs(b[i] * a[i][j] + b[j] * a[j][i] - b[i] * b[j]) < TOLERANCE for i in s for j in s
        )

    def _check(self) -> None:
        s = len(self.b)
        if len(self.c) != s or len(self.a) != s:
            raise TableauError(f"{s} weights b need {s} rows a and {s} times c")
        check_sums(self.c, self.a)
        weight = rooted_trees.weight(self.a)
        check_order("", self.order, self.b, weight)
        if self.b_low is not None:
            check_order("embedded method: ", self.low_order, self.b_low, weight)


@dataclass(frozen=True, kw_only=True)
class Explicit(_RungeKutta):
    """Explicit Runge-Kutta method.

    k_i = f(t + c_i h, y + h sum_j a_ij k_j), y1 = y + h sum b_i k_i.

    Dense output. With D = y1 - y0, F1 = h k_0 - D, F2 = 2 D - h (k_0 + f(y1)), the step's
    interpolant is y0 + s (D + (1 - s) (F1 + s (F2 + (1 - s) (F3 + s (F4 + ...))))), where
    F_(3 + m) = h sum_i dense[m]_i k_i. Without rows it is the cubic through both ends; its weights
    run over the stages, then f(y1), then the stages of `a_dense`, which only dense output needs.

    Raises TableauError when the table has not the declared order (Butcher's conditions, all rooted
    trees), when c_i is not the sum of row i, or when the embedded weights or the interpolant have
    not the order that they should.
    """

    b_lower: Numbers | None = None
    """A second embedded method, of still lower order, that keeps the estimate from vanishing."""
    dense: tuple[Numbers, ...] = ()
    """Rows F3, F4, ... of the interpolant."""
    a_dense: tuple[Numbers, ...] = ()
    c_dense: Numbers = ()
    implicit: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for i, row in enumerate(self.a):
            if len(row) != i:
                raise TableauError(f"row {i} of an explicit table has {i} numbers, not {len(row)}")
        self._check()
        if self.interpolates:
            self._check_dense()

    @property
    def first_same_as_last(self) -> bool:
        """Whether the last stage is f at the end of the step, the next step's first."""
        return self.stages > 1 and (*self.a[-1], 0.0) == tuple(self.b)

    @property
    def closed(self) -> tuple[Numbers, ...]:
        """Rows of a, where the last, if it was not already there, leads to the end of the step."""
        return self.a if self.first_same_as_last else (*self.a, self.b)

    @property
    def interpolates(self) -> bool:
        """Whether the interpolant's error is of the method's order; else a partial step serves."""
        return self.order <= 4 or bool(self.dense)

    def interpolant(self, share: float) -> Numbers:
        """Weights of the stages, of f(y1), and of `a_dense` in y(t + share h)."""
        s, r = share, 1 - share
        last = len(self.closed) - 1
        total = len(self.closed) + len(self.a_dense)
        result = [0.0] * total
        ends = [*self.b, *[0.0] * (total - self.stages)]
        start, end = [0.0] * total, [0.0] * total
        start[0], end[last] = 1.0, 1.0
        rows = [[x - d for x, d in zip(start, ends, strict=True)]]
        rows.append([2 * d - x - y for d, x, y in zip(ends, start, end, strict=True)])
        rows += [[*row, *[0.0] * (total - len(row))] for row in self.dense]
        factor = s
        for m, row in enumerate((ends, *rows)):
            result = [x + factor * y for x, y in zip(result, row, strict=True)]
            factor *= r if m % 2 == 0 else s
        return tuple(result)

    def _check_dense(self) -> None:
        rows = (*self.closed, *self.a_dense)
        check_sums((*self.c, *([] if self.first_same_as_last else [1.0]), *self.c_dense), rows)
        weight = rooted_trees.weight(rows)
        for share in (0.25, 0.7):
            b = self.interpolant(share)
            what = f"interpolant at {share:g}: "
            check_order(what, max(1, self.order - 1), b, weight, share)


@dataclass(frozen=True, kw_only=True)
class Implicit(_RungeKutta):
    """Implicit Runge-Kutta method: a full matrix a, or a lower one, which is solved row by row.

    With `a_explicit`, y' = f + g can be split: g takes a, and f the explicit rows, with the same b
    and c. Raises TableauError as `Explicit` does; a split method must have its order for every
    way to share the vertices of a tree between f and g.
    """

    a_explicit: tuple[Numbers, ...] = ()
    implicit: ClassVar[bool] = True

    def __post_init__(self) -> None:
        self._check()
        if self.a_explicit:
            self._check_split()

    def _check_split(self) -> None:
        if any(len(row) != i for i, row in enumerate(self.a_explicit)):
            raise TableauError("row i of an explicit part has i numbers")
        check_sums(self.c, self.a_explicit)
        weights = rooted_trees.coloured_weights(self.a, self.a_explicit)
        parts = [("split: ", self.order, self.b)]
        if self.b_low is not None:
            parts.append(("split, embedded method: ", self.low_order, self.b_low))
        for what, order, b in parts:
            for tree in rooted_trees.up_to(order):
                n, density = rooted_trees.vertices(tree), rooted_trees.density(tree)
                for weight in weights(tree):
                    check(what, order, n, b, weight, 1 / density)

    @property
    def diagonal(self) -> bool:
        """Whether every stage stands for itself: no number above the diagonal."""
        return all(x == 0 for i, row in enumerate(self.a) for x in row[i + 1 :])

    @property
    def spare_stages(self) -> tuple[int, ...]:
        """Stages that only the error estimate needs: explicit, and no part of any other's state."""
        spare: list[int] = []
        for j in reversed(range(len(self.b))):
            users = [i for i in range(len(self.b)) if self.a[i][j] and i not in spare]
            if not (self.b[j] or self.a[j][j] or users):
                spare.append(j)
        return tuple(sorted(spare))

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step that stands alone, without an estimate."""
        return len(self.b) - len(self.spare_stages)

    @property
    def filter(self) -> float:
        """Share of the step in the matrix that filters the error estimate: stiff parts vanish."""
        diagonal = [row[i] for i, row in enumerate(self.a) if row[i]]
        return diagonal[-1] if self.diagonal or self.b_low is None else self.b_low[0]


@dataclass(frozen=True, kw_only=True)
class Rosenbrock:
    """Linearly implicit Runge-Kutta method: one matrix 1 / (gamma h) - J, no iteration.

    (1 / (gamma h) - J) u_i = f(t + c_i h, y + sum_j a_ij u_j) + sum_j d_ij u_j / h + h g_i df/dt,
    y1 = y + sum b_i u_i. Hairer and Wanner, Solving Ordinary Differential Equations II, eq.
    IV.7.25. Raises TableauError when the table has not the declared order.
    """

    order: int
    gamma: float
    c: Numbers
    g: Numbers
    a: tuple[Numbers, ...]
    d: tuple[Numbers, ...]
    b: Numbers
    b_low: Numbers
    low_order: int
    implicit: ClassVar[bool] = True
    symplectic: ClassVar[bool] = False

    def __post_init__(self) -> None:
        lower, alpha = self.plain
        check_sums(self.c, alpha)
        check_sums(self.g, lower)
        check_order("", self.order, _times(self.b, lower), self.weight)
        check_order("embedded method: ", self.low_order, _times(self.b_low, lower), self.weight)

    @property
    def plain(self) -> tuple[list[list[float]], list[list[float]]]:
        """Gamma and alpha for k in place of u: the inverse of 1/gamma - d, and a Gamma."""
        s = range(self.stages)
        lower = [[0.0] * self.stages for _ in s]
        for i in s:
            lower[i][i] = self.gamma
            for j in range(i):
                inner = sum(self.d[i][m] * lower[m][j] for m in range(j, i))
                lower[i][j] = self.gamma * inner
        return lower, [_times(row, lower) for row in self.a]

    @property
    def weight(self) -> rooted_trees.Weight:
        """What stages weigh in the conditions of a tree."""
        lower, alpha = self.plain
        both = zip(alpha, lower, strict=True)
        return rooted_trees.weight(
            alpha, [[x + y for x, y in zip(p, q, strict=True)] for p, q in both]
        )

    @property
    def weights(self) -> list[float]:
        """Weights of the k in y1."""
        return _times(self.b, self.plain[0])

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step."""
        return len(self.b)


@dataclass(frozen=True, kw_only=True)
class Nystrom:
    """Runge-Kutta-Nystrom method for x'' = f(t, x).

    k_i = f(t + c_i h, x + c_i h v + h^2 sum_j a_ij k_j), x1 = x + h v + h^2 sum b_position_i k_i,
    v1 = v + h sum b_i k_i. Raises TableauError when the table has not the declared order.
    """

    order: int
    c: Numbers
    a: tuple[Numbers, ...]
    b: Numbers
    b_position: Numbers
    implicit: ClassVar[bool] = False
    symplectic: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_nystrom(self.order, self.b, self.b_position, self.weight)

    @property
    def weight(self) -> rooted_trees.Weight:
        """What stages weigh in the conditions of a tree."""
        return rooted_trees.nystrom_weight(self.c, self.a)

    @property
    def ends(self) -> tuple[Numbers, Numbers]:
        """Weights of the accelerations in position and velocity at the end."""
        return self.b_position, self.b

    @property
    def stages(self) -> int:
        """Evaluations of the acceleration in a step."""
        return len(self.b)


@dataclass(frozen=True, kw_only=True)
class Splitting:
    """Splitting of x' = v, v' = a(x, t): kicks d_i and drifts c_i in turn, kick first.

    `kicks` has one entry more than `drifts` (the first or last may be 0). A kick at time
    t + h sum(c so far) changes v by h d_i a; a relaxation a = -k (v - u) is integrated exactly in
    it. Symplectic. Raises TableauError when the coefficients have not the declared order: as a
    method for x'' = a(x), kick i lies at c_i = sum of drifts before it, and a_ij = d_j (c_i - c_j).
    """

    order: int
    kicks: Numbers
    drifts: Numbers
    implicit: ClassVar[bool] = False
    symplectic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if len(self.kicks) != len(self.drifts) + 1:
            raise TableauError("a splitting has one kick more than drifts; the last may be 0")
        check("drifts: ", 1, 1, self.drifts, [1.0] * len(self.drifts), 1.0)
        position, velocity = self.ends
        check_nystrom(self.order, velocity, position, self.weight)

    @property
    def weight(self) -> rooted_trees.Weight:
        """What kicks weigh in the conditions of a tree."""
        c, d = self.times, self.kicks
        a = [[d[j] * (c[i] - c[j]) for j in range(i)] for i in range(len(d))]
        return rooted_trees.nystrom_weight(c, a)

    @property
    def ends(self) -> tuple[Numbers, Numbers]:
        """Weights of the accelerations in position and velocity at the end."""
        left = [1 - time for time in self.times]
        return tuple(k * t for k, t in zip(self.kicks, left, strict=True)), self.kicks

    @property
    def stages(self) -> int:
        """Evaluations of the acceleration in a step."""
        return sum(kick != 0 for kick in self.kicks)

    @property
    def times(self) -> Numbers:
        """Time of every kick, as a share of the step."""
        result = [0.0]
        for drift in self.drifts:
            result.append(result[-1] + drift)
        return tuple(result)


@dataclass(frozen=True, kw_only=True)
class BackwardDifference:
    """Backward differentiation formula: sum_j a_j y_(n+1-j) = h f(t_(n+1), y_(n+1)), constant step.

    Raises TableauError when the formula is not exact for polynomials up to its order.
    """

    order: int
    a: Numbers
    implicit: ClassVar[bool] = True
    symplectic: ClassVar[bool] = False
    stages: ClassVar[int] = 1

    def __post_init__(self) -> None:
        for m in range(self.order + 1):
            powers = [float((-j) ** m) for j in range(len(self.a))]
            check("", self.order, m, self.a, powers, float(m == 1))


Table = Explicit | Splitting | Implicit | Rosenbrock | Nystrom | BackwardDifference
"""A method of any family."""


def composed(order: int, weights: Sequence[float]) -> Splitting:
    """Symmetric composition of leapfrogs of lengths w_1 ... w_m, w_0, w_m ... w_1, w_0 the rest.

    Each leapfrog is half a kick, a drift, half a kick; neighbouring kicks join.
    """
    lengths = [*weights, 1 - 2 * sum(weights), *reversed(weights)]
    halves = [length / 2 for length in lengths]
    kicks = (halves[0], *(x + y for x, y in pairwise(halves)), halves[-1])
    return Splitting(order=order, kicks=kicks, drifts=tuple(lengths))


def _times(row: Sequence[float], matrix: Sequence[Sequence[float]]) -> list[float]:
    """A row, which may be short of trailing zeros, times a square matrix."""
    return [sum(x * matrix[m][j] for m, x in enumerate(row)) for j in range(len(matrix))]
