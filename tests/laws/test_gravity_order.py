"""The order of particles along Morton's curve, whatever their places."""

import numpy as np
import pytest

from motes import gravity
from motes.interact.gravity import morton, room
from motes.interact.gravity.room import Room
from motes.interact.gravity.survey import of_columns

N = 20_000
LOW, SIZE = np.full(3, -0.5), 2.0


def keys(x):
    """Morton keys by taking bits one by one."""
    cells = ((x - LOW) * ((1 << 21) / SIZE * (1 - 2.0**-40))).astype(np.uint64)
    key = np.zeros(len(x), np.uint64)
    for bit in range(21):
        for axis in range(3):
            key |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(
                3 * bit + 2 - axis
            )
    return key


def clouds(n):
    rng = np.random.default_rng(1)
    x = rng.random((n, 3))
    crowd = x.copy()
    crowd[::2] = 0.5 + 1e-9 * rng.normal(size=crowd[::2].shape)
    crowd[1::5] = 0.1 + 1e-5 * rng.random(crowd[1::5].shape)
    crowd[::7] = 0.7
    return {
        "anywhere": x,
        "few places": np.round(x, 1),
        "one place": np.full((n, 3), 0.3),
        "crowds": crowd,
        "sorted": x[np.argsort(keys(x))],
    }


@pytest.mark.parametrize("name", clouds(1))
@pytest.mark.parametrize("n", [1, 2, 300, N, 5 * N])
def test_the_order_is_that_of_keys_then_rows(n, name):
    """Where places are shared, rows decide."""
    x, m = clouds(n)[name], np.random.default_rng(2).random(n)
    key = keys(x)
    order = np.argsort(key, kind="stable")
    found = morton.morton_order(x, m, LOW, SIZE, LOW, 2.0, 0.5, Room())
    np.testing.assert_array_equal(found.order, order)
    np.testing.assert_array_equal(found.key, key[order])
    np.testing.assert_array_equal(found.place, [*((x - LOW) / 2)[order].T, m[order] / 0.5])


def test_what_was_summed_before_changes_no_bit():
    """The memory of one solution is used by the next, which does not see what was in it."""
    rng = np.random.default_rng(2)
    x, m = rng.random((N, 3)), rng.random(N)
    room._kept.clear()
    alone = gravity.acceleration(x, m, tolerance=1e-2, method="multipole")
    gravity.field(rng.normal(size=(2 * N, 3)), np.ones(2 * N), tolerance=1e-5, method="multipole")
    assert room._kept
    after = gravity.acceleration(x, m, tolerance=1e-2, method="multipole")
    assert alone.tobytes() == after.tobytes()


def test_memory_is_kept_up_to_a_share_of_the_budget(monkeypatch):
    room._kept.clear()
    monkeypatch.setattr(room, "budget", lambda: 8_000)
    for size in (2_000, 900):
        with room.borrowed() as some:
            some.array("a", (size,), np.uint8)
        assert [kept.size for kept in room._kept] == ([] if size == 2_000 else [956])
    room._kept.clear()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("n", [0, 1, 7, 8, 1000, 30_001])
def test_columns_are_surveyed_whatever_their_order(n, kind):
    table = np.random.default_rng(n).normal(size=(n, 3)).astype(kind)
    for same in (table, np.asfortranarray(table), np.repeat(table, 2, axis=1)[:, ::2]):
        low, high, sums = of_columns(same)
        np.testing.assert_array_equal(low, table.min(axis=0, initial=np.inf))
        np.testing.assert_array_equal(high, table.max(axis=0, initial=-np.inf))
        np.testing.assert_allclose(sums, table.astype(float).sum(axis=0), rtol=1e-9, atol=1e-9 * n)
        if n:
            wrong = same.copy()
            wrong[n // 2, 1] = np.nan
            assert not np.isfinite(of_columns(wrong)[2][1])
