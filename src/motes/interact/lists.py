"""Lists of neighbours that stay right while points move a little.

A list holds what is within the radius and a skin. As long as no point has moved further than half
of the skin, no pair can have come within the radius from outside the list: 2 (skin / 2) = skin.
Source: Verlet, Physical Review 159 (1967) 98, section II.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.interact.cells import ROWS, Cells, apart, columns, grid, period, sort
from motes.interact.search import Found, Who, search
from motes.jit import STRICT, blocks, jit, share

SPARE = 1.25
"""Capacity of a new list over what it holds."""

CAUTION = 1 - 2.0**-10
"""Share of the allowed way after which a list is stale: more than rounding takes away."""


@jit(flags=STRICT)
def _moved(now: Any, then: Any, box: Any, limit: Any) -> Any:
    for i in range(now.shape[1]):
        dx = apart(now[0, i], then[0, i], box[0], True)
        dy = apart(now[1, i], then[1, i], box[1], True)
        dz = apart(now[2, i], then[2, i], box[2], True)
        if dx * dx + dy * dy + dz * dz > limit:
            return True
    return False


class NeighbourList:
    """Neighbours within `radius` of every point of one set, until points have moved too far.

    Points are listed in the order of cells, where neighbours are near in memory: `build` returns
    that order, whoever owns the points moves their rows by it, and the rows in the list are the
    new ones. A full list (both i, j and j, i) lets every row be summed by itself, free of races; a
    half list (i < j) holds each pair once.

    `radius`: of interaction, above 0 [m]. `skin`: added to it, at least 0 [m]. `box`: None, one
    period, or one for each dimension [m]. Raises ValueError for others. `builds` counts how often
    the list was built, `growths` how often its capacity was too small for that and grew.
    """

    def __init__(
        self,
        radius: float,
        skin: float,
        box: Any = None,
        *,
        dimensions: int = 3,
        half: bool = False,
    ) -> None:
        if not 0 < radius < np.inf:
            raise ValueError(f"radius = {radius} must be above 0 and finite")
        if not 0 <= skin < np.inf:
            raise ValueError(f"skin = {skin} must be at least 0 and finite")
        period(box, dimensions, np.float64)
        self.radius, self.skin, self.box = radius, skin, box
        self.dimensions, self.half = dimensions, half
        self.builds = 0
        self.growths = 0
        self._found = Found(np.zeros(1, np.int64), np.empty(0, np.int32))
        self._position: NDArray[Any] | None = None

    @property
    def first(self) -> NDArray[np.int64]:
        """(n + 1,) where the neighbours of each row begin in `row`."""
        return self._found.first

    @property
    def row(self) -> NDArray[np.int32]:
        """(pairs,) rows of neighbours, rising for each point."""
        return self._found.row[: self.first[-1]]

    @property
    def capacity(self) -> int:
        """Neighbours that fit without growth."""
        return self._found.row.size

    def stale(self, x: NDArray[Any]) -> bool:
        """Whether any of the points (n, dimensions) is about skin / 2 from where it was [m].

        So is a list of another number of points. Raises ValueError if a point is not finite.
        """
        then = self._position
        if then is None or then.shape[1] != len(x):
            return True
        real = then.dtype.type
        edges = period(self.box, self.dimensions, real)
        now, _ = columns(x.astype(real, copy=False), edges, "x")
        limit = real(self.skin / 2 * CAUTION) ** 2
        parts = blocks(len(x), ROWS)
        moved = np.zeros(len(parts), np.bool_)

        def look(part: int) -> None:
            rows = slice(*parts[part])
            moved[part] = _moved(now[:, rows], then[:, rows], edges, limit)

        share(look, len(parts))
        return bool(moved.any())

    def build(self, x: NDArray[Any]) -> NDArray[np.int32]:
        """List the neighbours of points (n, dimensions) and return the order (n,) of the new rows.

        Row k of the list is the point `x[order[k]]`. Raises ValueError if a point is not finite,
        MemoryBudgetError if the list would not fit.
        """
        real = np.float32 if x.dtype == np.float32 else np.float64
        edges = period(self.box, self.dimensions, real)
        position, bounds = columns(x.astype(real, copy=False), edges, "x")
        reach = self.radius + self.skin
        cut = grid(bounds, reach, edges)
        cells = sort(position, cut)
        order = cells.row
        ordered = Cells(
            cells.position,
            np.arange(len(order), dtype=np.int32),
            cells.key,
            cells.first,
            cells.shift,
        )
        who = Who.LATER if self.half else Who.OTHERS
        found = search(ordered, ordered, cut, reach, who, into=self._found.row, spare=SPARE)
        self.growths += self.builds > 0 and found.row is not self._found.row
        self._found, self._position = found, ordered.position
        self.builds += 1
        return order
