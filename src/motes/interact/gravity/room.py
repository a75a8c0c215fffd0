"""Memory that one solution after another uses: to get new pages takes longer than to fill them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from motes.machine.traced import LANES
from motes.memory import LINE, afford, budget

KEPT = 1 / 8
"""Share of the memory's budget that is kept for the next solution, at most."""


class Room:
    """Named pieces of memory."""

    def __init__(self) -> None:
        self._pieces: dict[str, NDArray[np.uint8]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> Any:
        """An array that begins at a cache line, of whatever was in a piece, which no array before
        it may need any more."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        piece = self._pieces.get(name)
        if piece is None or piece.size < size:
            afford(size, "the multipole method")
            self._pieces.pop(name, None)  # Before there is another one.
            whole = np.empty(size + size // 16 + LINE, np.uint8)
            first = -whole.ctypes.data % LINE
            piece = self._pieces[name] = whole[first : first + size + size // 16]
        return piece[:size].view(dtype).reshape(shape)

    def columns(self, name: str, rows: int, count: int) -> Any:
        """An array (rows, count) of doubles of which lanes may read on past the end."""
        size = rows * count
        return self.array(name, (size + LANES,))[:size].reshape(rows, count)

    @property
    def size(self) -> int:
        """Bytes of all pieces."""
        return sum(piece.size for piece in self._pieces.values())


_kept: list[Room] = []


@contextmanager
def borrowed() -> Iterator[Room]:
    """Room that nobody else uses meanwhile."""
    try:
        room = _kept.pop()
    except IndexError:
        room = Room()
    yield room
    # After a fault in the middle it is not kept: somebody may still look at it.
    if sum(other.size for other in [*_kept, room]) <= KEPT * budget():
        _kept.append(room)


def release() -> None:
    """Give back what is kept."""
    _kept.clear()
