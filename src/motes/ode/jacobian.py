"""df/dy of a system, and solves with I - h A x df/dy: dense, coloured, or matrix-free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motes.ode.arithmetic import Array

Apply = Callable[[Array], Array]


@dataclass(frozen=True)
class Newton:
    """How implicit methods solve their equations.

    `jacobian(t, y, *args)` gives df/dy, (n, n), of the flattened state. Without it, differences:
    `sparsity`, (n, n), tells which entries may differ from 0, and columns that share no row are
    differenced together (Curtis, Powell and Reid, IMA Journal of Applied Mathematics 13 (1974)).
    `solver="krylov"` never forms a matrix: GMRES with directional differences, for large systems.
    """

    jacobian: Callable[..., ArrayLike] | None = None
    sparsity: ArrayLike | None = None
    solver: Literal["dense", "krylov"] = "dense"
    iterations: int = 12
    """Newton iterations after which a step counts as having no solution."""


def colours(sparsity: ArrayLike, n: int) -> list[Array]:
    """Groups of columns of an (n, n) pattern, in none of which two have an entry in one row."""
    pattern = np.asarray(sparsity, bool)
    if pattern.shape != (n, n):
        raise ValueError(f"sparsity must be ({n}, {n}), not {pattern.shape}")
    groups: list[list[int]] = []
    filled: list[NDArray[np.bool_]] = []
    for column in range(n):
        rows = pattern[:, column]
        for group, taken in zip(groups, filled, strict=True):
            if not (taken & rows).any():
                group.append(column)
                taken |= rows
                break
        else:
            groups.append([column])
            filled.append(rows.copy())
    return [np.array(group) for group in groups]


@dataclass
class Linearisation:
    """f near one state: its value, its derivative, and what both have cost."""

    f: Callable[[float, Array], Array]
    newton: Newton
    args: tuple[Any, ...]
    n: int
    evaluations: int = 0
    t: float = np.nan
    y: Array = field(default_factory=lambda: np.zeros(0))
    value: Array = field(default_factory=lambda: np.zeros(0))
    matrix: Array | None = None

    def __post_init__(self) -> None:
        pattern = self.newton.sparsity
        if pattern is None:
            self.groups = [np.array([column]) for column in range(self.n)]
            self.pattern = np.ones((self.n, self.n), bool)
        else:
            self.groups = colours(pattern, self.n)
            self.pattern = np.asarray(pattern, bool)

    def move(self, t: float, y: Array) -> None:
        """Linearise at a state; where it is the last one, nothing is computed again."""
        if t == self.t and np.array_equal(y, self.y):
            return
        self.t, self.y = t, y.copy()
        self.value = self.f(t, y)
        self.evaluations += 1
        if self.newton.solver == "krylov":
            return
        if self.newton.jacobian is not None:
            given = np.asarray(self.newton.jacobian(t, y, *self.args), float)
            self.matrix = given.reshape(self.n, self.n)
            return
        step = np.sqrt(np.finfo(float).eps) * np.maximum(np.abs(y), 1e-5)
        self.matrix = np.zeros((self.n, self.n))
        for group in self.groups:
            moved = y.copy()
            moved[group] += step[group]
            change = self.f(t, moved) - self.value
            for column in group:
                rows = self.pattern[:, column]
                self.matrix[rows, column] = change[rows] / (moved[column] - y[column])
        self.evaluations += len(self.groups)

    def times(self, v: Array) -> Array:
        """df/dy v, by a difference along v where there is no matrix."""
        if self.matrix is not None:
            return np.asarray(self.matrix @ v)
        size = float(np.sqrt(v @ v))
        if size == 0:
            return np.zeros_like(v)
        step = np.sqrt(np.finfo(float).eps * (1 + float(np.sqrt(self.y @ self.y)))) / size
        self.evaluations += 1
        change: Array = (self.f(self.t, self.y + step * v) - self.value) / step
        return change

    def solver(self, a: Array, h: float) -> Apply:
        """What solves (I - h a x df/dy) X = R for R of shape (stages, n), a of (stages, stages)."""
        stages = len(a)
        if self.matrix is not None:
            whole = np.eye(stages * self.n) - h * np.kron(a, self.matrix)
            inverse = np.linalg.inv(whole)

            def multiply(r: Array) -> Array:
                result: Array = (inverse @ r.reshape(-1)).reshape(stages, self.n)
                return result

            return multiply

        def apply(x: Array) -> Array:
            columns = x.reshape(stages, self.n)
            turned = np.stack([self.times(column) for column in columns])
            result: Array = (columns - h * a @ turned).reshape(-1)
            return result

        return lambda r: gmres(apply, r.reshape(-1)).reshape(stages, self.n)


def gmres(apply: Apply, b: Array, tolerance: float = 1e-6, most: int = 60) -> Array:
    """Solve A x = b for A given by its product, to a residual of `tolerance` |b|.

    Saad and Schultz, SIAM Journal on Scientific and Statistical Computing 7 (1986) 856-869.
    """
    size = float(np.sqrt(b @ b))
    if size == 0:
        return np.zeros_like(b)
    basis = [b / size]
    hessenberg = np.zeros((most + 1, most))
    for j in range(min(most, b.size)):
        w = apply(basis[j])
        for _ in range(2):  # Twice is enough (Kahan): the basis stays orthogonal.
            for i, q in enumerate(basis):
                share = float(w @ q)
                hessenberg[i, j] += share
                w = w - share * q
        hessenberg[j + 1, j] = np.sqrt(w @ w)
        right = np.zeros(j + 2)
        right[0] = size
        part = hessenberg[: j + 2, : j + 1]
        x = np.linalg.lstsq(part, right, rcond=None)[0]
        residual = float(np.linalg.norm(part @ x - right))
        if residual <= tolerance * size or hessenberg[j + 1, j] <= 1e-14 * size:
            break
        basis.append(w / hessenberg[j + 1, j])
    return np.stack(basis[: len(x)]).T @ x
