"""Numbers in kernels: arithmetic, comparisons, conversions, functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from both_ways import DOUBLES, REALS, WHOLES, WITH_COMPILER, compiled, every, same
from hypothesis import example
from hypothesis import strategies as st

pytestmark = WITH_COMPILER


def _real_arithmetic(a, b):
    smaller, larger = min(a, b), max(a, b)
    return a + b, a - b, a * b, -a, abs(b), smaller, larger, a < b, a <= b, a == b, a != b


def _whole_arithmetic(a, b):
    return a + b, a - b, a * b, a // b, a % b, -a, abs(b), a & b, a | b, a ^ b, a > b, a >= b


def _shifts(a, n):
    return a << n, a >> n, ~a


def _order(a, b):
    return a < b, a > b, a == b


def _casts(x):
    small, k = np.float32(x), np.int64(x)
    return small, k, np.int32(k), np.uint8(k & 255), np.float64(small), bool(k), int(x)


def _bits(x):
    return x.view(np.int32), x.view(np.uint32), x.view(np.uint32).view(np.float32)


real_arithmetic, whole_arithmetic = compiled(_real_arithmetic), compiled(_whole_arithmetic)
shifts, order, casts, bits = map(compiled, (_shifts, _order, _casts, _bits))


@every(DOUBLES, DOUBLES)
@example(0.0, -0.0)
@example(math.nan, 1.0)
def test_doubles_are_those_of_python(a, b):
    np.testing.assert_equal(real_arithmetic(a, b), _real_arithmetic(a, b))


@every(REALS, REALS)
def test_singles_are_those_of_numpy(a, b):
    a, b = np.float32(a), np.float32(b)
    with np.errstate(all="ignore"):
        expected = _real_arithmetic(a, b)
    np.testing.assert_equal(real_arithmetic(a, b), expected)


def _quotient(a, b):
    return a / b


quotient = compiled(_quotient)


@every(DOUBLES, DOUBLES.filter(lambda b: b != 0))
def test_a_quotient_is_pythons(a, b):
    np.testing.assert_equal(quotient(a, b), a / b)


@every(WHOLES, WHOLES.filter(lambda b: b != 0))
@example(-7, 2)
@example(7, -2)
def test_integers_are_those_of_python(a, b):
    assert whole_arithmetic(a, b) == _whole_arithmetic(a, b)


@every(st.integers(0, 2**64 - 1), st.integers(1, 2**64 - 1))
def test_unsigned_integers_wrap(a, b):
    with np.errstate(all="ignore"):
        expected = _whole_arithmetic(np.uint64(a), np.uint64(b))
    assert whole_arithmetic(np.uint64(a), np.uint64(b)) == expected


@every(WHOLES, st.integers(0, 31))
def test_shifts_are_those_of_python(a, n):
    assert shifts(a, n) == _shifts(a, n)


@every(st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**64 - 1))
@example(-1, 2**64 - 1)
def test_signed_and_unsigned_compare_by_value(a, b):
    assert order(np.int64(a), np.uint64(b)) == (a < b, a > b, a == b)


def test_a_division_of_integers_by_zero_gives_zero():
    def divide(a, b):
        return a // b, a % b

    assert compiled(divide)(7, 0) == (0, 0)


@every(st.floats(-1e9, 1e9))
def test_casts_are_those_of_numpy(x):
    assert casts(x) == _casts(np.float64(x))


@pytest.mark.parametrize("x", [0.0, 0.25, 2.5, -2.5, 3.5, 1e30, -7.0])
def test_functions_of_numbers(x):
    def functions(x):
        root = np.sqrt(abs(x))
        down, up, near = np.floor(x), np.ceil(x), np.round(x)
        odd = x % 2.0, x // 2.0, np.isfinite(x), np.isnan(x / x if x != 0.0 else x)
        return root, down, up, near, odd, x**2, x**-1 if x != 0.0 else x**1

    same(functions, x)


@every(REALS)
def test_bits_of_a_number(x):
    np.testing.assert_equal(bits(np.float32(x)), _bits(np.float32(x)))


@pytest.mark.parametrize("x", [0.0, 0.3, 7.0, 1e200, math.inf])
def test_powers_of_halves_and_of_any_number(x):
    def powers(x, p):
        return x**1.5, x**-0.5, x**0.5, x**2.5, x**p, math.exp(-x), math.sin(x % 1.0)

    with np.errstate(all="ignore"):
        x, p = np.float64(x), np.float64(0.7)
        expected = x**1.5, x**-0.5, x**0.5, x**2.5, x**p, np.exp(-x), np.sin(x % 1.0)
        expected = tuple(map(float, expected))
    assert compiled(powers)(x, p) == pytest.approx(expected, rel=1e-15, nan_ok=True)
