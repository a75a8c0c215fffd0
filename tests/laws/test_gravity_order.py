"""The order of particles along Morton's curve, sorted anew or from the last one."""

import numpy as np
import pytest

from motes import gravity
from motes.interact.gravity import morton, nearly

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


def checked(x):
    key = keys(x)
    order = np.argsort(key, kind="stable")
    found = morton.morton_order(x, LOW, SIZE)
    np.testing.assert_array_equal(found[1], order)
    np.testing.assert_array_equal(found[0], key[order])


@pytest.fixture(autouse=True)
def forgotten():
    nearly._last.clear()
    yield
    nearly._last.clear()


@pytest.mark.parametrize("step", [0.0, 1e-7, 1e-4, 0.3])
def test_the_order_is_that_of_keys_then_rows_whatever_was_before(step):
    """Some places are shared, so that rows decide; a few particles jump far."""
    rng = np.random.default_rng(1)
    x = np.round(rng.random((N, 3)), 2)
    checked(x)
    for _ in range(3):
        x = np.clip(x + step * rng.normal(size=x.shape), 0, 1)
        x[rng.choice(N, 50)] = rng.random((50, 3))
        x[rng.choice(N, 500)] = x[rng.choice(N, 500)]
        checked(x)


def test_a_last_order_that_is_nearly_right_is_mended():
    rng = np.random.default_rng(1)
    x = rng.random((N, 3))
    morton.morton_order(x, LOW, SIZE)
    assert morton._again(x + 1e-6, LOW, (1 << 21) / SIZE) is not None
    assert morton._again(rng.random((N, 3)), LOW, (1 << 21) / SIZE) is None


def test_what_was_summed_before_changes_no_bit():
    rng = np.random.default_rng(2)
    x, m = rng.random((N, 3)), rng.random(N)
    moved = x + 1e-5 * rng.normal(size=x.shape)
    alone = gravity.acceleration(moved, m, tolerance=1e-2, method="multipole")
    nearly._last.clear()
    gravity.acceleration(x, m, tolerance=1e-2, method="multipole")
    after = gravity.acceleration(moved, m, tolerance=1e-2, method="multipole")
    assert alone.tobytes() == after.tobytes()
