"""Time-stepping methods as tables; a wrong table refuses to exist.

Two families: Runge-Kutta methods (`Explicit`), given by a Butcher tableau, and splittings
(`Splitting`), given by the lengths of their kicks (velocity changes) and drifts (position changes).
One table drives fused loops over independent particles and staged ones over interacting particles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

TOLERANCE = 1e-12
"""How exactly a table must meet its order conditions; tables are written as double fractions."""


class TableauError(ValueError):
    """A table does not have the order that it declares."""


@dataclass(frozen=True, kw_only=True)
class Explicit:
    """Explicit Runge-Kutta method: k_i = f(t + c_i h, y + h sum_j a_ij k_j), y1 = y + h sum b_i k_i.

    Raises TableauError when the table has not the declared order (Butcher's conditions, up to
    order 4), when c_i is not the sum of row i, or when the embedded weights are not consistent.
    """

    order: int
    c: tuple[float, ...]
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    b_low: tuple[float, ...] | None = None
    """Weights of the embedded method, for the error estimate."""
    implicit: ClassVar[bool] = False
    symplectic: ClassVar[bool] = False

    def __post_init__(self) -> None:
        s = len(self.b)
        if len(self.c) != s or len(self.a) != s:
            raise TableauError(f"{s} weights b need {s} rows a and {s} times c")
        for i, row in enumerate(self.a):
            if len(row) != i:
                raise TableauError(f"row {i} of an explicit table has {i} numbers, not {len(row)}")
            if abs(sum(row) - self.c[i]) > TOLERANCE:
                raise TableauError(f"c[{i}] = {self.c[i]:g}, but row {i} of a adds up to {sum(row):g}")
        _check("", self.order, self.conditions(self.b))
        if self.b_low is not None:
            _check("embedded method: ", 1, self.conditions(self.b_low))

    def conditions(self, b: tuple[float, ...]) -> list[tuple[int, float, float]]:
        """Butcher's order conditions: (order, value, what it must be), up to order 4.

        Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, table II.2.1.
        """
        c = self.c
        s = range(len(b))
        ac = [sum(a * c[j] for j, a in enumerate(row)) for row in self.a]
        ac2 = [sum(a * c[j] ** 2 for j, a in enumerate(row)) for row in self.a]
        aac = [sum(a * ac[j] for j, a in enumerate(row)) for row in self.a]
        return [
            (1, sum(b), 1),
            (2, sum(b[i] * c[i] for i in s), 1 / 2),
            (3, sum(b[i] * c[i] ** 2 for i in s), 1 / 3),
            (3, sum(b[i] * ac[i] for i in s), 1 / 6),
            (4, sum(b[i] * c[i] ** 3 for i in s), 1 / 4),
            (4, sum(b[i] * c[i] * ac[i] for i in s), 1 / 8),
            (4, sum(b[i] * ac2[i] for i in s), 1 / 12),
            (4, sum(b[i] * aac[i] for i in s), 1 / 24),
        ]

    @property
    def stages(self) -> int:
        """Evaluations of the right-hand side in a step."""
        return len(self.b)


@dataclass(frozen=True, kw_only=True)
class Splitting:
    """Splitting of x' = v, v' = a(x, t): kicks d_i and drifts c_i in turn, kick first.

    `kicks` has one entry more than `drifts` (its last may be 0). A kick at time t + h sum(c so far)
    changes v by h d_i a; a relaxation a = -k (v - u) is integrated exactly in it. Symplectic.
    Raises TableauError when the coefficients have not the declared order (checked up to 2).
    """

    order: int
    kicks: tuple[float, ...]
    drifts: tuple[float, ...]
    implicit: ClassVar[bool] = False
    symplectic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if len(self.kicks) != len(self.drifts) + 1:
            raise TableauError("a splitting has one kick more than drifts; the last may be 0")
        before, moment = 0.0, 0.0
        for kick, drift in zip(self.kicks, (*self.drifts, 0.0), strict=True):
            moment += kick * before
            before += drift
        conditions = [(1, sum(self.kicks), 1.0), (1, sum(self.drifts), 1.0), (2, moment, 1 / 2)]
        _check("", self.order, conditions)

    @property
    def stages(self) -> int:
        """Evaluations of the acceleration in a step."""
        return sum(kick != 0 for kick in self.kicks)

    @property
    def times(self) -> tuple[float, ...]:
        """Time of every kick, as a share of the step."""
        result = [0.0]
        for drift in self.drifts:
            result.append(result[-1] + drift)
        return tuple(result)


Method = Explicit | Splitting


def _check(what: str, declared: int, conditions: list[tuple[int, float, float]]) -> None:
    for order, value, target in conditions:
        if order <= declared and abs(value - target) > TOLERANCE:
            raise TableauError(
                f"{what}declared order {declared}, but an order-{order} condition gives "
                f"{value:.6g} instead of {target:.6g}"
            )
