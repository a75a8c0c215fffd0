"""The one place where large arrays come from: it checks a memory budget before it allocates."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from motes.errors import MemoryBudgetError

SHARE = 0.8
"""Share of the memory available at the first use that is the budget, unless MOTES_MEMORY says."""

_budget: int | None = None


LINE = 64
"""Bytes of a cache line."""


def budget() -> int:
    """Bytes that one array may have: MOTES_MEMORY (in MiB), or 80 % of what is available."""
    global _budget
    if _budget is None:
        import psutil

        chosen = os.environ.get("MOTES_MEMORY", "")
        available = int(psutil.virtual_memory().available * SHARE)
        _budget = int(float(chosen) * 2**20) if chosen.replace(".", "", 1).isdigit() else available
    return _budget


def afford(size: int, what: str) -> None:
    """Raise MemoryBudgetError when so many bytes, together, are more than the budget."""
    if size > budget():
        raise MemoryBudgetError(
            f"{what} would need {_shown(size)}, more than the budget of {_shown(budget())}. "
            "Emit fewer particles, shorten their life, set a capacity, or raise MOTES_MEMORY [MiB]."
        )


def allocate(shape: tuple[int, ...], dtype: DTypeLike, what: str) -> NDArray[Any]:
    """An array of zeros that begins at a cache line.

    Raises MemoryBudgetError, with nothing allocated, when it is too large.
    """
    size = int(np.prod(shape, dtype=object)) * np.dtype(dtype).itemsize
    afford(size, what)
    try:
        room = np.zeros(size + LINE, np.uint8)
    except MemoryError:
        message = f"{what} would need {_shown(size)}; the system has no more."
        raise MemoryBudgetError(message) from None
    start = -room.ctypes.data % LINE
    return room[start : start + size].view(dtype).reshape(shape)


def _shown(size: int) -> str:
    return f"{size / 2**30:.1f} GiB" if size >= 2**30 else f"{size / 2**20:.0f} MiB"
