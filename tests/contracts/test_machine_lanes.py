"""Several numbers at once in kernels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from both_ways import WITH_COMPILER, compiled, same

from motes.errors import SceneError
from motes.jit import STRICT, jit
from motes.machine.lanes import bits as marks_of
from motes.machine.lanes import (
    choose,
    fetch,
    largest,
    lowest,
    put,
    put_some,
    rough_inverse_root,
    settled,
    spread_over,
    streams,
    take,
    total,
)
from motes.machine.traced import (
    LANES,
    gathered,
    inverse_root,
    ones,
    scattered,
    traced,
    write_totals,
)

pytestmark = WITH_COMPILER


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
            fetch(x, i + 8)
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
        held = 0
        for i in range(0, x.size, 8):
            held += put_some(out, held, take(x, i, 8), take(x, i, 8) < limit)
        return held

    marked = np.unpackbits(np.arange(256, dtype=np.uint8)).astype(bool)
    for kind in (np.int32, np.float32, np.float64, np.int64):
        x = (np.arange(2048) % 40 + np.where(marked, 0, 40)).astype(kind)
        out = np.zeros(2056, kind)
        held = compiled(pack_some)(x, kind(40), out)
        assert held == marked.sum()
        np.testing.assert_array_equal(out[:held], x[marked])
    assert (put_some(out, 5, out[0], False), put_some(out, 5, out[0], True)) == (0, 1)
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


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_lanes_are_summed_compared_and_kept_as_arrays_are(real: Any) -> None:
    """A kernel of eight lanes, and the same function in plain Python, whose lanes are an array."""

    def parts(x: Any, names: Any, kept: Any, out: Any) -> Any:
        found = 0
        for i in range(0, x.size, 8):
            lanes = take(x, i, 8)
            positive = choose(lanes > 0, lanes, -2 * lanes)
            put(out, i, positive + spread_over(x[i], 8))
            found += put_some(kept, found, take(names, i, 8), lanes > 0.25)
            out[i] += total(positive) - largest(lanes)
        return found

    rng = np.random.default_rng(5)
    # Multiples of 1/16: sums are exact in any order.
    x = (rng.integers(-32, 32, 64) / 16).astype(real)
    names = np.arange(100, 164, dtype=np.int32)
    kept, expected = np.zeros((2, 72), np.int32)
    out, plain = np.zeros((2, 64), real)
    count = compiled(parts)(x, names, kept, out)
    assert count == parts(x, names, expected, plain) == (x > 0.25).sum()
    np.testing.assert_array_equal(kept[:count], names[x > 0.25])
    np.testing.assert_array_equal(out, plain)


def test_an_estimated_root_has_eleven_bits() -> None:
    def roots(x: Any, out: Any) -> None:
        for i in range(0, x.size, 8):
            put(out, i, rough_inverse_root(take(x, i, 8)))

    x = np.geomspace(1e-30, 1e30, 4096, dtype=np.float32)
    out = np.zeros_like(x)
    compiled(roots)(x, out)
    np.testing.assert_allclose(out * np.sqrt(x.astype(float)), 1, rtol=2.0**-11)


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_a_traced_formula_does_what_it_does_with_arrays(real: Any) -> None:
    """Columns of chosen rows of tables, arithmetic with lanes and numbers, rows written back."""

    @traced
    def formula(table: Any, chosen: Any, factor: Any, rows_: Any, sums: Any, out: Any) -> Any:
        columns = gathered(table, chosen, 6)
        value = columns[0] * factor - columns[5] * 0.5 + rows_[1]
        write_totals(sums, [value, -columns[3]])
        scattered([value, columns[1], columns[2]], out, 3)
        rows_[0] = ones(value) / (value * value + 1.0)
        return value, inverse_root(value * value + 2.0)

    def call(table: Any, chosen: Any, factor: Any, rows_: Any, sums: Any, out: Any) -> None:
        value, root = formula(table, chosen, factor, rows_, sums, out)
        put(rows_[2], 0, value * root)

    rng = np.random.default_rng(6)
    table = (rng.integers(-64, 64, (40, 8)) / 16).astype(real)
    chosen = rng.integers(0, 40, LANES).astype(np.int32)
    found = rng.integers(-8, 8, (3, LANES)).astype(real), np.zeros(2, real)
    found += (np.zeros((LANES + 4, LANES), real),)
    plain = tuple(array.copy() for array in found)
    compiled(call)(table, chosen, real(0.25), *found)
    call(table, chosen, real(0.25), *plain)
    for one, other in zip(found, plain, strict=True):
        few = one[:, :3] if one.shape[0] == LANES + 4 else one
        np.testing.assert_allclose(few, other[:, :3] if few is not one else other, rtol=1e-6)


def test_a_loop_over_long_arrays_fetches_ahead_and_does_nothing_else() -> None:
    """A hint for each array in the SIMD loop, also past an array's end; none without the word."""

    def scaled(x: Any, y: Any) -> None:
        streams()
        for i in range(x.size):
            y[i] += np.float32(0.5) * x[i]

    def without(x: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] += np.float32(0.5) * x[i]

    x, y = np.arange(2000, dtype=np.float32).reshape(2, 1000)
    same(scaled, x, y)
    hints = [compiled(f).llvm(x, y).count("call void @llvm.prefetch") for f in (scaled, without)]
    assert hints[0] >= 2
    assert hints[1] == 0
