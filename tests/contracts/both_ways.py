"""Kernels run both ways: compiled without any freedom in their arithmetic, and as plain Python on
NumPy's scalars; the results are the same to the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motes.jit import STRICT, Kernel, jit

WITH_COMPILER = [
    pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning"),
    pytest.mark.skipif(jit(lambda: 0).__class__ is not Kernel, reason="without the compiler"),
]

REALS = st.floats(allow_subnormal=True, width=32)
DOUBLES = st.floats()
WHOLES = st.integers(-(2**31), 2**31 - 1)


def every(*numbers: Any) -> Any:
    """Try a test with many numbers; the first time takes as long as a compilation."""
    return lambda test: settings(deadline=None)(given(*numbers)(test))


def compiled(function: Any) -> Any:
    """A kernel that the compiler must make by itself, without reordered arithmetic."""
    return jit(function, flags=STRICT, numba=False)


def same(function: Any, *arguments: Any) -> Any:
    """Run both ways on copies of the arguments; what is returned and written must agree."""

    def copied() -> list[Any]:
        return [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]

    plain, machine = copied(), copied()
    with np.errstate(all="ignore"):
        expected = function(*plain)
    found = compiled(function)(*machine)
    np.testing.assert_equal(found, expected)
    for one, other in zip(machine, plain, strict=True):
        np.testing.assert_array_equal(one, other)
    return found
