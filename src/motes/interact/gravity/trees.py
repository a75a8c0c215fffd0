"""What one sum leaves for the next: the cells of its trees, and what it might neglect."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.tree import MASS, RADIUS, Tree

if TYPE_CHECKING:
    from motes.interact.gravity.desk import Limits
    from motes.interact.gravity.multipole import Problem
    from motes.interact.gravity.plan import Plan

GROWN = 1.1
"""Growth of the leaves' radii from which a tree is made anew."""

SUMS = 16
"""Sums with one tree, at most: then the error is measured again."""


class Shape(NamedTuple):
    """Which particles are in which cells, wherever they are."""

    order: NDArray[np.uint32]
    cells: NDArray[np.int32]
    leaves: NDArray[np.int32]
    largest: int

    @staticmethod
    def of(tree: Tree) -> Shape:
        """That of a tree, whose memory others may use later."""
        return Shape(tree.order.copy(), tree.cells.copy(), tree.leaves.copy(), tree.largest)


@dataclass(frozen=True)
class Kept:
    """What is known after a sum."""

    kind: tuple[Any, ...]
    """What must be the same for it to hold: numbers of particles, the law, units, the tolerance."""
    plan: Plan
    limits: Limits
    mass: float
    extent: float
    """Sum of the radii of all leaves."""
    sources: Shape
    targets: Shape | None
    """None where they are the sources."""
    sums: int = 1


class Trees:
    """Trees that are used again by the next sum over the same particles, while these move little.

    Cells keep their particles, up to 16 sums or until radii of leaves have grown by a tenth; balls
    and moments follow from where the particles are. What may be neglected is kept, too. A sum then
    depends on those before it, within the tolerance.
    """

    def __init__(self) -> None:
        self.kept: Kept | None = None

    def again(self, kind: tuple[Any, ...]) -> Kept | None:
        """What is known, if it is of such a sum and not too old."""
        kept = self.kept
        return kept if kept and kept.kind == kind and kept.sums < SUMS else None

    def keep(self, kind: tuple[Any, ...], problem: Problem, limits: Limits) -> None:
        """Remember a sum with new trees."""
        apart = problem.targets is not problem.sources
        sources, targets = Shape.of(problem.sources), Shape.of(problem.targets) if apart else None
        size = _mass(problem), _extent(problem)
        self.kept = Kept(kind, problem.plan, limits, *size, sources, targets)

    def do(self, kept: Kept, problem: Problem) -> bool:
        """Whether trees with the cells that they had do for one more sum."""
        if _extent(problem) > GROWN * kept.extent or _mass(problem) * GROWN < kept.mass:
            return False
        self.kept = replace(kept, sums=kept.sums + 1)
        return True

    def copy(self) -> Trees:
        """The same, which goes its own way."""
        other = Trees()
        other.kept = self.kept
        return other

    def arrays(self) -> Iterator[NDArray[Any]]:
        """Everything that can change the next bit."""
        if kept := self.kept:
            yield np.array([kept.sums, kept.mass, kept.extent, *kept.limits])
            for shape in (kept.sources, kept.targets):
                if shape:
                    yield from (shape.order, shape.cells)


def _mass(problem: Problem) -> float:
    return float(problem.sources.bodies[0, MASS])


def _extent(problem: Problem) -> float:
    """Sum of the radii of all leaves."""
    trees = {id(tree): tree for tree in (problem.sources, problem.targets)}
    return float(sum(tree.bodies[tree.leaves, RADIUS].sum() for tree in trees.values()))
