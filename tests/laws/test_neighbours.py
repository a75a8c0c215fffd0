"""Neighbour search: what must hold for any points, without looking at how it is done."""

import tracemalloc

import numpy as np
import pytest

import motes.errors
import motes.jit
import motes.memory
from motes import neighbours
from motes.interact.lists import NeighbourList


@pytest.fixture
def cloud():
    return np.random.default_rng(3).random((20_000, 3))


def test_poisson_points_have_the_volume_of_the_ball_as_mean_number_of_pairs(cloud):
    """E[pairs] = n (n - 1)/2 V(r) in a periodic unit box, with variance equal to that mean."""
    n, radius = len(cloud), 0.07
    expected = n * (n - 1) / 2 * 4 / 3 * np.pi * radius**3
    i, _ = neighbours.pairs(cloud, radius, box=1.0)
    assert len(i) == pytest.approx(expected, abs=5 * np.sqrt(expected))


def test_pairs_are_sorted_and_each_is_there_once(cloud):
    i, j = neighbours.pairs(cloud, 0.05)
    assert np.all(i < j)
    number = i.astype(np.int64) * len(cloud) + j
    assert np.all(np.diff(number) > 0)


def test_every_pair_is_seen_from_both_sides(cloud):
    """within is symmetric, (i, j) <=> (j, i), and is twice the pairs."""
    i, j = neighbours.within(cloud, 0.06, box=1.0)
    order = np.lexsort((i, j))
    np.testing.assert_array_equal((j[order], i[order]), (i, j))
    later = i < j
    np.testing.assert_array_equal((i[later], j[later]), neighbours.pairs(cloud, 0.06, box=1.0))


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_order_of_points_only_renames_rows(cloud, real):
    x = cloud.astype(real)
    order = np.random.default_rng(5).permutation(len(x))
    i, j = neighbours.pairs(x[order], 0.05, box=1.0)
    a, b = np.minimum(order[i], order[j]), np.maximum(order[i], order[j])
    sort = np.lexsort((b, a))
    np.testing.assert_array_equal((a[sort], b[sort]), neighbours.pairs(x, 0.05, box=1.0))
    index, distance = neighbours.nearest(x, 6)
    new_index, new_distance = neighbours.nearest(x[order], 6)
    np.testing.assert_array_equal(new_distance, distance[order])
    np.testing.assert_array_equal(order[new_index], index[order])


def test_threads_change_nothing(cloud):
    results = []
    try:
        for count in (1, 2, 4):
            motes.jit.threads(count)
            found = (neighbours.pairs(cloud, 0.05, box=1.0), neighbours.nearest(cloud, 7))
            results.append(b"".join(array.tobytes() for part in found for array in part))
    finally:
        motes.jit.threads(0)
    assert results[0] == results[1] == results[2]


@pytest.mark.parametrize("cells", [1, 2, 3, 4])
def test_a_lattice_has_its_coordination_shells_in_any_number_of_cells(cells):
    """Simple cubic, a = 1: 6 neighbours at 1; 12 at sqrt 2; no image counts twice.

    In a box of 2 edges both ways lead to the same neighbour: one of them counts.
    """
    edge = 3 * cells
    x = np.stack(np.meshgrid(*[np.arange(edge)] * 3), axis=-1).reshape(-1, 3).astype(float)
    for radius, number in ((1.0, 6), (1.5, 18)):
        i, _ = neighbours.within(x, radius, box=float(edge))
        assert np.all(np.bincount(i) == number)
    small = np.stack(np.meshgrid(*[np.arange(2.0)] * 3), axis=-1).reshape(-1, 3)
    i, _ = neighbours.within(small, 1.0, box=2.0)
    assert np.all(np.bincount(i) == 3)


def test_a_point_at_the_end_of_the_box_is_at_its_beginning():
    """x = L, x = 0 and x = -1e-30, which rounds to L when it is wrapped, are one place."""
    x = np.array([[5.0, 1, 1], [0.0, 1, 1], [-1e-30, 1, 1], [4.95, 1, 1]])
    i, j = neighbours.pairs(x, 0.1, box=5.0)
    assert list(zip(i, j, strict=True)) == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    _, distance = neighbours.nearest(x, 2, box=5.0)
    assert np.all(distance[:3] == 0)


def test_the_radius_itself_is_within():
    """|x_i - x_j| = r exactly, on both sides of cells and of the border."""
    x = np.array([[0.0, 0], [0.25, 0], [0.5, 0], [3.75, 0]])
    i, j = neighbours.pairs(x, 0.25, box=4.0)
    assert list(zip(i, j, strict=True)) == [(0, 1), (0, 3), (1, 2)]


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_chain_is_linked_by_its_spacing(axis, real):
    """x_k = k a: n - 1 pairs within a in open space, n in a box of n a, wherever cells end."""
    x = np.zeros((400, 3), real)
    x[:, axis] = np.arange(400) * 0.25
    i, j = neighbours.pairs(x, 0.25)
    np.testing.assert_array_equal(j - i, np.ones(399))
    assert len(neighbours.pairs(x - 17, 0.25, box=100.0)[0]) == 400


def test_one_axis_can_be_periodic():
    x = np.array([[0.1, 0.1, 0.1], [9.9, 0.1, 0.1], [0.1, 9.9, 0.1]])
    i, j = neighbours.pairs(x, 0.5, box=(10.0, np.inf, np.inf))
    assert list(zip(i, j, strict=True)) == [(0, 1)]


@pytest.mark.parametrize("spread", [1e-300, 1e3, -1e9, -1e30, 1e200])
def test_a_point_far_away_changes_nothing_for_the_others(cloud, spread):
    """Cells cost memory and time for points, not for the space between them."""
    x = np.concatenate([cloud, [[spread, 2.0, 2.0]]])
    np.testing.assert_array_equal(neighbours.pairs(x, 0.03), neighbours.pairs(cloud, 0.03))
    index, _ = neighbours.nearest(x, 3)
    assert index.shape == (len(x), 3)


def test_nearest_are_the_closest_of_those_within(cloud):
    """The k-th distance is the radius of the smallest ball that holds k others."""
    k = 9
    _, distance = neighbours.nearest(cloud, k, box=1.0)
    assert np.all(np.diff(distance, axis=1) >= 0)
    radius = float(np.sort(distance[:, -1])[-1]) * (1 + 1e-12)
    i, j = neighbours.within(cloud, radius, box=1.0)
    apart = np.abs(cloud[i] - cloud[j])
    apart = np.sqrt((np.minimum(apart, 1 - apart) ** 2).sum(axis=1))
    closer = np.bincount(i[apart < distance[i, -1] * (1 - 1e-12)], minlength=len(cloud))
    assert np.all(closer == k - 1)


def test_coincident_points_are_neighbours_at_distance_zero():
    x = np.ones((600, 3))
    i, _ = neighbours.pairs(x, 1e-6)
    assert len(i) == 600 * 599 // 2
    index, distance = neighbours.nearest(x, 2)
    assert np.all(distance == 0)
    assert index[0].tolist() == [1, 2]
    assert index[5].tolist() == [0, 1]


@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_points(n):
    x = np.arange(3.0 * n).reshape(n, 3)
    i, j = neighbours.pairs(x, 6.0)
    assert len(i) == len(j) == n * (n - 1) // 2
    index, distance = neighbours.nearest(x, 3)
    assert index.shape == distance.shape == (n, 3)
    assert np.count_nonzero(index >= 0) == n * (n - 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, 0], [1, np.nan, 2]], 1.0), r"x\[1\] = \[1.0, nan, 2.0\] is not finite"),
        (([[np.inf, 0]], 1.0), r"x\[0\]"),
        (([1.0, 2.0, 3.0], 1.0), r"x must be \(n, 3\) or \(n, 2\), not \(3,\)"),
        (([[0, 0, 0]], 0.0), "radius = 0.0 must be above 0"),
        (([[0, 0, 0]], np.nan), "radius = nan must be above 0"),
        (([[0, 0, 0]], 1.0, (1.0, 2.0)), "box must be one length or 3"),
        (([[0, 0, 0]], 1.0, -1.0), "edges above 0"),
        (([[0, 0, 0]], 1.0, np.nan), "edges above 0"),
        (([[0, 0, 0]], "wide"), "radius must be an array of real numbers"),
        (([[0, 0, 0]], [1.0, 2.0]), r"radius must be one number, not of shape \(2,\)"),
        (([[0, 0, 0], [1, 2]], 1.0), "x must be an array of real numbers, all rows as long"),
        (([[0j, 0, 0]], 1.0), "x must be an array of real numbers"),
        ((None, 1.0), "x must be an array of real numbers"),
    ],
)
def test_bad_points_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        neighbours.pairs(*arguments)


def test_bad_targets_are_named():
    with pytest.raises(ValueError, match=r"targets\[0\]"):
        neighbours.within(np.zeros((2, 3)), 1.0, [[np.nan, 0, 0]])
    with pytest.raises(ValueError, match="as many coordinates"):
        neighbours.within(np.zeros((2, 3)), 1.0, np.zeros((2, 2)))
    for k, message in ((0, "at least 1"), (2.5, "a whole number"), ("few", "a whole number")):
        with pytest.raises(ValueError, match=f"k = {k!r} must be {message}"):
            neighbours.nearest(np.zeros((2, 3)), k)


def test_what_would_not_fit_is_refused_before_it_is_allocated(monkeypatch):
    """10 000 points at one place are 5e7 pairs, 0.2 GB; 1e8 nearest of each, 8 TB."""
    monkeypatch.setattr(motes.memory, "_budget", 50 << 20)
    with pytest.raises(motes.errors.MemoryBudgetError, match="a list of neighbours would need"):
        neighbours.pairs(np.ones((10_000, 3)), 1.0)
    with pytest.raises(motes.errors.MemoryBudgetError, match="100000000 nearest of 10000 places"):
        neighbours.nearest(np.ones((10_000, 3)), 10**8)


@pytest.mark.parametrize("box", [None, 1e9])
def test_empty_space_costs_nothing(cloud, box):
    """20 000 points in a cube of 1e6 radii or more: no more memory than some hundred bytes each."""
    far = cloud * 1e9
    tracemalloc.start()
    try:
        assert len(neighbours.pairs(far, 1e3, box)[0]) == 0
        index, distance = neighbours.nearest(far, 2, box)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 400 * len(far)
    near, apart = neighbours.nearest(cloud, 2, box and 1.0)
    np.testing.assert_array_equal(index, near)
    np.testing.assert_allclose(distance, apart * 1e9, rtol=1e-7)


def test_a_dense_clump_in_wide_space():
    """Pairs within the clump, and the nearest of who is alone, as in the clump and space apart."""
    rng = np.random.default_rng(4)
    clump, wide = rng.random((3_000, 3)) * 1e-4, rng.random((3_000, 3)) * 100 + 1.0
    x = np.concatenate([clump, wide])
    found = neighbours.pairs(x, 1e-5)
    np.testing.assert_array_equal(found, neighbours.pairs(clump, 1e-5))
    assert len(found[0]) > 1_000
    index, distance = neighbours.nearest(x, 3)
    inner = neighbours.nearest(clump, 3)
    np.testing.assert_array_equal(index[:3_000], inner[0])
    np.testing.assert_array_equal(distance[:3_000], inner[1])


def test_places_of_others_are_wrapped_into_the_box_like_points(cloud):
    """Targets a whole number of periods away find the same points."""
    targets = cloud[:50] + 1e-3
    whole = np.array([1.0, -2.0, 3.0])
    index, distance = neighbours.nearest(cloud, 4, box=1.0, targets=targets)
    away = neighbours.nearest(cloud, 4, box=1.0, targets=targets + whole)
    np.testing.assert_array_equal(away[0], index)
    np.testing.assert_allclose(away[1], distance, atol=1e-14)
    i, j = neighbours.within(cloud, float(distance.max()), targets, box=1.0)
    assert set(zip(np.repeat(np.arange(50), 4), index.ravel(), strict=True)) <= set(
        zip(i.tolist(), j.tolist(), strict=True)
    )


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize("box", [None, 1.0])
def test_a_list_that_is_not_stale_misses_no_pair(half, box):
    """Until the first point has moved skin / 2, all pairs within the radius are in the list."""
    rng = np.random.default_rng(7)
    x = rng.random((2_000, 3))
    neighbours_of = NeighbourList(0.08, 0.02, box, half=half)
    x = x[neighbours_of.build(x)]
    velocity = rng.normal(size=x.shape) * 1e-4
    steps = 0
    while not neighbours_of.stale(x):
        i, j = neighbours.pairs(x, 0.08, box)
        owner = np.repeat(np.arange(len(x)), np.diff(neighbours_of.first))
        listed = owner * len(x) + neighbours_of.row
        assert np.all(np.isin(i.astype(np.int64) * len(x) + j, listed))
        if not half:
            assert np.all(np.isin(j.astype(np.int64) * len(x) + i, listed))
        x = x + velocity
        steps += 1
    fastest = np.sqrt((velocity**2).sum(axis=1)).max()
    assert steps == pytest.approx(0.01 / fastest, abs=1.5)


def test_a_list_reaches_through_its_skin_and_lasts_until_half_of_it():
    """Listed up to r + s; stale as soon as one point has gone s/2, from which two could meet."""
    radius, skin = 1.0, 0.2
    for apart, number in ((radius + skin - 1e-9, 1), (radius + skin + 1e-9, 0)):
        neighbours_of = NeighbourList(radius, skin, half=True)
        neighbours_of.build(np.array([[0.0, 0, 0], [apart, 0, 0]]))
        assert len(neighbours_of.row) == number
    for way, stale in ((0.499 * skin, False), (0.5 * skin, True)):
        assert neighbours_of.stale(np.array([[0.0, 0, 0], [apart - way, 0, 0]])) == stale


def test_a_list_grows_and_says_so():
    rng = np.random.default_rng(8)
    x = rng.random((500, 3))
    neighbours_of = NeighbourList(0.1, 0.0)
    neighbours_of.build(x)
    first, capacity = len(neighbours_of.row), neighbours_of.capacity
    assert capacity >= first
    neighbours_of.build(x * 1.01)
    assert (neighbours_of.growths, neighbours_of.capacity) == (0, capacity)
    neighbours_of.build(x / 2)
    assert (neighbours_of.builds, neighbours_of.growths) == (3, 1)
    assert capacity < len(neighbours_of.row) <= neighbours_of.capacity
    i, _ = neighbours.within(x / 2, 0.1)
    assert len(neighbours_of.row) == len(i)


def test_a_list_is_stale_before_it_is_built_and_after_births():
    x = np.random.default_rng(9).random((100, 3))
    neighbours_of = NeighbourList(0.1, 0.0)
    assert neighbours_of.stale(x)
    x = x[neighbours_of.build(x)]
    assert not neighbours_of.stale(x)
    assert neighbours_of.stale(x[:99])
    assert neighbours_of.stale(x + 1e-9)
    x[7, 1] = np.nan
    with pytest.raises(ValueError, match=r"x\[7\]"):
        neighbours_of.stale(x)


@pytest.mark.parametrize("keys", [3, 700, 5000])
def test_rows_are_counted_into_order(keys: int) -> None:
    """Stable order by whole keys: that of NumPy's, with where each key begins; a room serves again
    for fewer and for more."""
    from motes.interact.counting_sort import Room, counted_rows, sorted_rows

    room: Room = {}
    for n in (1, 2, 1237, 40, 3001):
        key = np.random.default_rng(n).integers(0, keys, n).astype(np.uint64)
        expected = np.argsort(key, kind="stable")
        found, row, first = counted_rows(key, keys, room)
        np.testing.assert_array_equal(row, expected)
        np.testing.assert_array_equal(found, key[expected])
        np.testing.assert_array_equal(first, np.searchsorted(key[expected], np.arange(keys + 1)))
        found, row = sorted_rows(key, 13)
        np.testing.assert_array_equal(row, expected)
