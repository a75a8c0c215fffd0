"""Targets that stand for all: where errors are measured before all sums are formed."""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.tree import END, RADIUS, START, Tree

EVERY = 160
"""Most target leaves that are all taken."""

LEAVES = 16
"""Target leaves in the first class of the sample: those of the largest radius, all of them."""

CROWDED = 1 / LEAVES
"""Share of the targets from which a leaf is in the first class as well: a pile at one place."""

LEAVES_OF_A_CLASS = 6
"""Fewest target leaves out of each further class, which has twice as many as the one before."""

LEAVES_BY_SHARE, ONE_IN = 32, 1000
"""More target leaves, that many or one in so many, out of each class as many as is its share of the
targets: where most are, a few leaves would leave the mean uncertain."""

LARGEST = 4.0
"""Times by which a value may be larger than is usual before it is taken for that."""

DEVIATIONS = 3.0
"""Standard errors of a ratio of mean squares by which it may be larger than the sample says."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Some targets that stand for all, whole leaves."""

    ranges: NDArray[np.int64]
    """(k, 2) rows in the order of the tree, first and last + 1, of each leaf."""
    rows: NDArray[np.intp]
    """The same one by one."""
    weight: NDArray[np.float64]
    """How many targets each row stands for."""
    classes: NDArray[np.intp]
    """(c + 1,) where the leaves of each class begin, and their end."""
    chance: NDArray[np.float64]
    """(c,) share of the leaves of a class that were not chosen."""

    def usual(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values, none larger than LARGEST times the mean of most: of all but the largest sixteenth
        of those that are not zero.

        Close pairs and large masses may dominate means of few targets by chance, which would allow
        too large errors.
        """
        order = np.argsort(values)
        order = order[values[order] > 0.0]
        if not len(order):
            return values
        share = np.cumsum(self.weight[order])
        most = order[share <= max(share[-1] * 15 / 16, share[0])]
        usual = (self.weight[most] * values[most]).sum() / self.weight.sum()
        few_are_larger: NDArray[np.float64] = np.minimum(values, LARGEST * usual)
        return few_are_larger

    def mean_of_most(self, values: NDArray[np.float64]) -> float:
        """Mean of values as far as they are usual."""
        return float(np.average(self.usual(values), weights=self.weight))

    def typical(self, values: NDArray[np.float64]) -> float:
        """Root mean square of most values."""
        return math.sqrt(self.mean_of_most(values**2))

    def relative(
        self, wrong: NDArray[np.float64], values: NDArray[np.float64], rounding: float
    ) -> float:
        """Largest likely rms error, in units of what is typical, without large values' rounding.

        The ratio of mean squares over all is that of the sample within its standard error, which
        follows from how much leaves of one class differ in what they have more than this ratio.
        """
        more = np.maximum(np.abs(wrong) - rounding * values, 0.0)
        counts = self.ranges[:, 1] - self.ranges[:, 0]
        typical = self.usual(values**2)
        errors, scale = (float((self.weight * v).sum()) for v in (more**2, typical))
        if scale == 0.0:
            return 0.0
        ratio = errors / scale
        apart = self.weight * (more**2 - ratio * typical)
        sums = np.add.reduceat(apart, np.cumsum(counts) - counts)
        variance = 0.0
        for first, last, chance in zip(
            self.classes[:-1], self.classes[1:], self.chance, strict=True
        ):
            if chance:
                variance += chance * (last - first) * sums[first:last].var(ddof=1)
        return math.sqrt(ratio + DEVIATIONS * math.sqrt(variance) / scale)

    def drift(self, wrong: NDArray[np.float64], values: NDArray[np.float64]) -> float:
        """Sum of vectors (3, n) over all, as a share of the sum of values."""
        total = float(np.linalg.norm((self.weight * wrong).sum(axis=1)))
        return total / (float((self.weight * values).sum()) or math.inf)


def sample_of(tree: Tree) -> Sample:
    """Leaves in classes by radius, as the largest errors are those of few large leaves.

    Those chosen from a class are far from each other along the tree's curve.
    """
    leaves, cells, targets = tree.leaves, tree.cells, tree.place.shape[1]
    classes = [LEAVES << k for k in range(32 if len(leaves) > EVERY else 0)]
    borders = [size for size in classes if size < len(leaves)]
    held = cells[leaves, END] - cells[leaves, START]
    if borders:
        sizes = np.where(held > CROWDED * targets, np.inf, tree.bodies[leaves, RADIUS])
        order = np.argpartition(-sizes, borders)
        leaves, held = leaves[order], held[order]
    by_share = max(LEAVES_BY_SHARE, len(leaves) // ONE_IN)
    chosen, weights, chances = [], [], []
    for first, last in zip([0, *borders], [*borders, len(leaves)], strict=True):
        some = np.sort(leaves[first:last])
        every = int(held[first:last].sum())
        number = LEAVES_OF_A_CLASS if first else len(some)
        number = min(max(number, by_share * every // targets), len(some))
        picked = some[(np.arange(number) * 2 + 1) * len(some) // (2 * number)]
        counts = cells[picked, END] - cells[picked, START]
        chosen.append(picked)
        weights.append(np.repeat(every / counts.sum(), counts.sum()))
        chances.append(1 - number / len(some))
    ranges: Any = cells[np.concatenate(chosen), :2].astype(np.int64)
    rows = np.concatenate([np.arange(*r) for r in ranges])
    begins = np.cumsum([0, *map(len, chosen)])
    return Sample(ranges, rows, np.concatenate(weights), begins, np.array(chances))
