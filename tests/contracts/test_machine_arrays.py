"""Tuples, arrays and calls in kernels."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from both_ways import WITH_COMPILER, compiled, same

from motes.errors import SceneError
from motes.jit import STRICT, jit

pytestmark = WITH_COMPILER


class Point(NamedTuple):
    x: Any
    y: Any


def test_tuples_named_and_plain():
    weights = (0.5, 0.25, 2.0)

    def mix(p, k):
        q = Point(p.y, p.x + weights[k])
        (a, b), c = q, weights
        both = (a, b) + c[1:]  # noqa: RUF005
        return q.x, both, len(both), c[-1], Point(1, k)

    for k in range(3):
        assert same(mix, Point(1.5, 2.5), k)[1][2:] == (0.25, 2.0)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.uint8, np.bool_])
@pytest.mark.parametrize("turned", [False, True], ids=["packed", "strided"])
def test_elements_and_parts_of_arrays(dtype, turned):
    def work(a, out, lo, hi):
        part = a[1][lo:hi]
        for i in range(part.size):
            out[i] = part[i]
        out[part.size :] = a[0, 0]
        column = a[lo:, -1]
        inner = a[1:, 1:3]
        rows, width = inner.shape
        for i in range(rows):
            out[i] = inner[i, width - 1]
        a[0, 1:hi] = part[0]
        a[-1, 0] = a[1, 1]
        return column.size, inner.shape, a.ndim, len(a), inner.size

    a = (np.arange(24).reshape(4, 6) % 7).astype(dtype)
    a = np.asfortranarray(a) if turned else a
    same(work, a, np.zeros(6, dtype), 1, 4)
    same(work, a[:, ::2] if turned else a, np.zeros(6, dtype), 0, 2)


def test_ends_of_slices_are_clipped():
    def sizes(x, lo, hi):
        return x[lo:hi].size, x[:hi].size, x[lo:].size, x[: hi - 3].size, x[-2:].size

    for lo in (-9, -2, 0, 3, 9):
        for hi in (-9, -1, 0, 2, 99):
            same(sizes, np.arange(5.0), lo, hi)


def test_arrays_of_a_kernels_own():
    def sort(x, n):
        few, many = np.zeros(4, np.int32), np.empty((n, 2), x.dtype)
        many[:] = x[0]
        for i in range(n):
            few[i % 4] += i
            many[i, 1] = x[i % x.size] * few[i % 4]
        s = 0.0
        for i in range(n):
            if many[i, 1] < 0:
                return -s
            s += many[i, 0] + many[i, 1]
        return s

    same(sort, np.array([0.5, 1.5, 2.5]), 9)
    same(sort, np.array([0.5, -1.5, 2.5]), 100_000)


def test_kernels_call_kernels():
    @jit(flags=STRICT, inline=True)
    def both(a, b):
        return a + b, a - b

    @jit(flags=STRICT)
    def last(x):
        return x[x.size - 1], x

    def outer(x, h):
        s, d = both(x[0], h)
        e, y = last(x)
        f = both(e, 2)[1]
        return s * d + f, y[0]

    plain = {"both": both.py_func, "last": last.py_func}

    def expected(x, h):
        s, d = plain["both"](x[0], h)
        e, y = plain["last"](x)
        return s * d + plain["both"](e, 2)[1], y[0]

    x = np.array([1.5, 2.5])
    assert compiled(outer)(x, np.float32(0.5)) == expected(x, np.float32(0.5))


TABLE = np.array([[0.5, -1.25], [3.0, 1e-300]])
FLAGS = np.array([True, False])


def test_arrays_of_a_module_are_part_of_the_code_and_only_read():
    def looked_up(i, j):
        return TABLE[i, j] * (2.0 if FLAGS[j] else 3.0), TABLE[1:].size

    def overwritten(x):
        TABLE[0, 0] = x

    for place in ((0, 0), (0, 1), (1, 0), (1, 1)):
        same(looked_up, *place)
    with pytest.raises(SceneError, match="only read"):
        compiled(overwritten)(1.0)


def test_a_function_may_return_an_array_of_its_own():
    """Each call has one of its own, which lives as long as its caller's numbers."""

    def shifted(x, h):
        result = np.empty(3)
        for i in range(3):
            result[i] = x[i] + h
        return result, h

    def twice(x):
        return shifted(shifted(x, 10.0)[0], 100.0)[0]

    def outer(x, out):
        a, b = twice(x), shifted(x, 1.0)[0]
        for i in range(3):
            out[0, i], out[1, i] = a[i], b[i]

    same(outer, np.array([1.0, 2.0, 3.0]), np.zeros((2, 3)))

    def looped(x):
        for _ in range(3):
            x = twice(x)
        return x[0]

    with pytest.raises(SceneError, match="inside a loop"):
        compiled(looped)(np.zeros(3))


def test_a_lambda_is_a_function_and_two_in_a_line_are_not():
    square = lambda x, h: x * x + h  # noqa: E731
    same(square, 1.5, 0.25)
    twins = [lambda x: x, lambda x: 2 * x]
    with pytest.raises(SceneError, match="cannot be read"):
        compiled(twins[1])(1.0)


def test_arrays_in_other_shapes():
    def turned(x, n):
        y, z = x.reshape((n, -1)), x.reshape(2, 3).ravel()
        y[0, 1] += z[5]
        return y[1, 0], y.shape[1], z.size

    same(turned, np.arange(6.0), 3)
    with pytest.raises(SceneError, match="follow each other"):
        compiled(turned)(np.arange(12.0)[::2], 3)
