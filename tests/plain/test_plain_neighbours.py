"""Neighbours by their definition: all distances, one loop."""

import numpy as np
import pytest

from motes import neighbours


def wrapped(x, box):
    """Points in [0, L) along each axis with a finite period L."""
    x = np.array(x)
    for axis, length in enumerate(np.broadcast_to(np.asarray(box, x.dtype), x.shape[1:])):
        if np.isfinite(length):
            value = x[:, axis]
            outside = (value < 0) | (value >= length)
            value = np.where(outside, value - length * np.floor(value / length), value)
            value = np.where(value < 0, value + length, value)
            x[:, axis] = np.where(value >= length, 0, value)
    return x


def squares(x, targets, box=np.inf):
    """Squared distances (m, n) of nearest images, summed x, y, z in the points' precision."""
    box = np.broadcast_to(np.asarray(box, x.dtype), x.shape[1:])
    x, targets = wrapped(x, box), wrapped(targets, box)
    total = np.zeros((len(targets), len(x)), x.dtype)
    for axis, length in enumerate(box):
        apart = np.abs(targets[:, axis, None] - x[:, axis])
        apart = np.minimum(apart, length - apart)
        total += apart * apart
    return total


def plain_pairs(x, radius, box=np.inf):
    near = squares(x, x, box) <= x.dtype.type(radius) ** 2
    return np.nonzero(np.triu(near, 1))


def plain_within(x, radius, targets, box=np.inf):
    return np.nonzero(squares(x, targets, box) <= x.dtype.type(radius) ** 2)


def plain_nearest(x, k, box=np.inf):
    far = squares(x, x, box)
    np.fill_diagonal(far, np.inf)
    index = np.argsort(far, axis=1, kind="stable")[:, :k]
    return index, np.sqrt(np.take_along_axis(far, index, axis=1))


def clouds():
    """Points of any number, size, precision and density, many on a lattice, some far away."""
    rng = np.random.default_rng(1)
    for trial in range(60):
        dimensions, real = 2 + trial % 2, (np.float32, np.float64)[trial // 2 % 2]
        x = rng.random((rng.integers(0, 150), dimensions)) * 10 ** rng.uniform(-1, 2)
        if trial % 3 == 0:
            x = np.round(x, 1)
        if trial % 5 == 0:
            x[:1] += 10 ** rng.uniform(0, 20)
        box = rng.choice([1.0, 3.0, 7.0, np.inf], dimensions) if trial % 4 else None
        if box is not None:
            x[rng.random(x.shape) < 0.1] = 3.0
        yield (x - 5 * rng.random()).astype(real), 10 ** rng.uniform(-2, 1), box


@pytest.mark.parametrize(("x", "radius", "box"), list(clouds()))
def test_neighbours_are_those_of_the_double_loop(x, radius, box):
    edges = np.inf if box is None else box
    np.testing.assert_array_equal(neighbours.pairs(x, radius, box), plain_pairs(x, radius, edges))
    targets = np.linspace(-6, 9, 40 * x.shape[1], dtype=x.dtype).reshape(-1, x.shape[1])
    np.testing.assert_array_equal(
        neighbours.within(x, radius, targets, box), plain_within(x, radius, targets, edges)
    )
    index, distance = neighbours.nearest(x, 5, box)
    there = min(5, max(len(x) - 1, 0))
    expected = plain_nearest(x, there, edges)
    np.testing.assert_array_equal(index[:, :there], expected[0])
    np.testing.assert_array_equal(distance[:, :there], expected[1])
    assert np.all(index[:, there:] == -1)
    assert np.all(distance[:, there:] == np.inf)
