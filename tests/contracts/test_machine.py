"""The compiler: each construct of a kernel means what it means in plain Python on NumPy's scalars.

Every function here runs twice, compiled without any freedom in its arithmetic, and as it is
written; the results are the same to the last bit.
"""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import motes.jit
from motes.errors import SceneError
from motes.jit import STRICT, Kernel, jit
from motes.machine.lanes import bits as marks_of
from motes.machine.lanes import count, lowest, pack, put, settled, take

pytestmark = [
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


# ---------------------------------------------------------------------------- arithmetic


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


# ---------------------------------------------------------------------------- ways through code


def test_choices_and_conditions():
    def choose(x, n):
        a = 1.0 if x > 0.5 else 2 * x
        b = (x, a) if (n > 3 and x > 0.1) or n == 0 else (a, x)
        if x > 0.9:
            kind = 3
        elif not x > 0.2:
            return a, b, 0, x < 0.1 < a
        else:
            kind = n if n in (1, 5, 7) else -1
        return a, b, kind, 0.3 < x <= 0.6

    for x in (0.05, 0.15, 0.3, 0.55, 0.95):
        for n in (0, 1, 4, 5):
            same(choose, x, n)


def test_a_name_may_be_an_integer_first_and_real_later():
    def total(x):
        s = 0
        for i in range(x.size):
            s += x[i]
        return s

    same(total, np.linspace(0.1, 2, 11))
    same(total, np.arange(7))


def test_loops_with_breaks_and_early_returns():
    def search(x, wanted, limit):
        found = -1
        for i in range(x.size):
            if x[i] < 0:
                continue
            if x[i] == wanted:
                found = i
                break
            if x[i] > limit:
                return found, i
        k, n = 1, 0
        while k < 1000:
            k *= 2
            n += 1
            if k > limit:
                break
        return found, n

    x = np.array([3.0, -1.0, 8.0, 5.0, 2.0])
    for wanted in (8.0, 2.0, 9.0):
        for limit in (4.0, 7.0, 100.0):
            same(search, x, wanted, limit)


def test_loops_within_loops_and_what_they_leave_behind():
    def spiral(n):
        a, b, last = 1, 1, 0
        for i in range(n):
            for j in range(i, 2 * n, 3):
                if (i * j) % 5 == 4:
                    break
                a, b = b, (a + 3 * b + j) % 1009
                last = j
        for k in range(5, 0, -2):
            a += k
        return a, b, last, k

    for n in (1, 4, 9):
        same(spiral, n)


def test_a_loop_over_a_tuple_is_written_out():
    def sums(p, out):
        for k, (a, b) in enumerate(p):
            if a > b:
                continue
            out[k] = a + b
        for row in range(3):
            out[row] += p[row][0]

    same(sums, ((1.0, 2), (3.0, 1), (2.0, 5)), np.zeros(3))


def test_a_condition_that_is_known_hides_code_that_would_not_fit():
    present, absent = True, None

    def pick(x):
        if absent is not None:
            return x.nothing
        if not present:
            return x[0]
        return x if present else x.nothing

    assert same(pick, 2.5) == 2.5


def test_the_rest_of_a_condition_is_not_looked_at_in_vain():
    """An index that `and` protects is never used; 4096 places away there may be no memory."""

    def guarded(x, i):
        return (i < x.size and x[i] > 0.5) or i == 1 << 40

    x = np.array([0.2, 0.9])
    for i in (0, 1, 2, 1 << 40):
        same(guarded, x, i)


# ---------------------------------------------------------------------------- tuples and arrays


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


@pytest.mark.parametrize("x", [0.0, 0.3, 7.0, 1e200, math.inf])
def test_powers_of_halves_and_of_any_number(x):
    def powers(x, p):
        return x**1.5, x**-0.5, x**0.5, x**2.5, x**p, math.exp(-x), math.sin(x % 1.0)

    with np.errstate(all="ignore"):
        x, p = np.float64(x), np.float64(0.7)
        expected = x**1.5, x**-0.5, x**0.5, x**2.5, x**p, np.exp(-x), np.sin(x % 1.0)
        expected = tuple(map(float, expected))
    assert compiled(powers)(x, p) == pytest.approx(expected, rel=1e-15, nan_ok=True)


# ---------------------------------------------------------------------------- faults, cache


def test_what_is_outside_the_language_is_said_in_one_line():
    def strange(x):
        y = [x]
        return y

    def unknown(x):
        return x + nowhere  # noqa: F821

    def early(x):
        for i in range(3):
            if i > x:
                return y  # noqa: F821
            y = i  # noqa: F841
        return x

    for function, word in (
        (strange, "List"),
        (unknown, '"nowhere"'),
        (early, "before it has a value"),
    ):
        with pytest.raises(SceneError) as caught:
            compiled(function)(1.0)
        message = str(caught.value)
        assert word in message
        assert function.__name__ in message
        assert "test_machine.py:" in message
        assert "\n" not in message


def test_outside_of_scenes_numba_compiles_the_rest():
    @jit
    def unusual(x):
        return [x, 2 * x][1]

    assert unusual(2.0) == 4.0
    assert unusual.foreign


def test_a_kept_kernel_is_not_compiled_again_and_a_damaged_one_is(tmp_path, monkeypatch):
    monkeypatch.setenv("MOTES_CACHE", str(tmp_path))
    told: list[str] = []
    monkeypatch.setattr(motes.jit, "_listener", told.append)

    def half(x):
        return 0.5 * x

    assert compiled(half)(3.0) == 1.5
    assert compiled(half)(5.0) == 2.5
    assert told == ["half"]
    (file,) = (tmp_path / "kernels").glob("half-*")
    file.write_bytes(file.read_bytes()[:-50])
    assert compiled(half)(7.0) == 3.5
    assert told == ["half", "half"]


def test_a_film_needs_no_numba(tmp_path):
    """Kernels of simulation and drawing are inside the language; Numba takes longer to import."""
    program = (
        "import sys, motes; scene = motes.load('sprinkler').with_values({'film.size': [96, 64]});"
        f"motes.film(scene, {str(tmp_path)!r}, last=3); print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_vectors_change_lanes_as_plain_python_says(real):
    from motes.machine.shuffles import near_slots, taken_apart

    rng = np.random.default_rng(4)
    records, slots = rng.random((50, 4)).astype(real), rng.integers(0, 50, 64).astype(np.int32)

    def columns(records, slots, out):
        taken_apart(records, slots, out[0], out[1], out[2])

    same(columns, records, slots, np.zeros((3, 64), real))
    x, limit = rng.random((3, 64)).astype(real), real(0.16)

    def near(x, limit, slots, out):
        half = limit - limit + x.dtype.type(0.5)
        return near_slots(half, half, half, limit, np.int32(slots[3]), x[0], x[1], x[2], slots, out)

    places = np.full(80, -1, np.int32), np.full(80, -1, np.int32)
    found = compiled(near)(x, limit, slots, places[0])
    assert found == near(x, limit, slots, places[1])
    assert 3 < found < 64
    assert (places[0][:found] == places[1][:found]).all()


# ---------------------------------------------------------------------------- lanes


def test_lanes_are_numbers_side_by_side() -> None:
    """A function of single numbers works on eight at once: arithmetic, choices, ways, bits."""

    def law(x: Any, y: Any) -> Any:
        far = np.sqrt(x * x + y * y)
        w = 1.0 - far if far < 1.0 else -0.5 * y
        if (x > y) & (far >= 0.25) and not far > 3.0:
            w = abs(w) + max(x, 0.25)
            y = -y
        else:
            w = min(w, x / (far + 1.0))
        return w + y, far > 1.0

    inner = jit(law, flags=STRICT, inline=True)

    def eight(x: Any, y: Any, out: Any, marks: Any) -> None:
        for i in range(0, x.size, 8):
            value, far = inner(take(x, i, 8), y[i])
            put(out, i, settled(value) + 1)
            whole = marks_of(far)
            while whole != np.uint64(0):
                marks[np.uint64(i) + lowest(whole)] = 1
                whole &= whole - np.uint64(1)

    def one(x: Any, y: Any, out: Any, marks: Any) -> None:
        for i in range(x.size):
            value, far = law(take(x, i, 1), y[i // 8 * 8])
            put(out, i, settled(value) + x.dtype.type(1))
            marks[i + int(lowest(1))] = marks_of(far)

    rng = np.random.default_rng(1)
    for real in (np.float32, np.float64):
        x, y = rng.normal(size=(2, 64)).astype(real) * real(2)
        found, expected = np.zeros((2, 64), real)
        marks, told = np.zeros((2, 64), np.int32)
        compiled(eight)(x, y, found, marks)
        one(x, y, expected, told)
        np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(marks, told)


@pytest.mark.parametrize("moves", [True, False])
def test_marked_lanes_are_packed(
    moves: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Lanes whose bits are set follow one another, with and without AVX2, as in plain Python."""
    from motes.machine import target

    monkeypatch.setenv("MOTES_CACHE", str(tmp_path))  # Kept code would be that of this processor.
    if not moves:
        monkeypatch.setattr(target, "moves_lanes", lambda: False)

    def pack_some(x: Any, limit: Any, out: Any) -> Any:
        held = np.uint64(0)
        for i in range(0, x.size, 8):
            marks = marks_of(take(x, i, 8) < limit)
            pack(out, held, take(x, i, 8), marks)
            held += count(marks)
        return held

    marked = np.unpackbits(np.arange(256, dtype=np.uint8)).astype(bool)
    for kind in (np.int32, np.float32, np.float64, np.int64):
        x = (np.arange(2048) % 40 + np.where(marked, 0, 40)).astype(kind)
        out = np.zeros(2056, kind)
        held = compiled(pack_some)(x, kind(40), out)
        assert held == marked.sum()
        np.testing.assert_array_equal(out[:held], x[marked])
    assert count(np.uint64(0b1011)) == 3
    pack(out, 5, out[0], np.uint64(1))
    assert out[5] == out[0]


def test_lanes_go_the_same_way() -> None:
    """A loop that would end for some lanes only, and a write for some, are refused."""

    def ends(x: Any) -> None:
        a = take(x, 0, 8)
        while a > 0:
            a = a - 1
        put(x, 0, a)

    def writes(x: Any) -> None:
        if take(x, 0, 8) > 0:
            x[0] = 1.0

    for function in (ends, writes):
        with pytest.raises(SceneError, match="lanes"):
            compiled(function)(np.ones(8))
