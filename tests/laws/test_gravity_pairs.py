"""Laws of pairs that are rough: sums in single precision with the processor's estimate of 1 / r."""

import numpy as np
import pytest
from test_gravity_multipole import distributions, relative

from motes import gravity
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.pairs import attraction
from motes.interact.gravity.plan import plans
from motes.interact.gravity.softening import ROUGH


@pytest.mark.parametrize("n", [3000, 20_000])
def test_rough_pairs_of_large_forces_that_cancel_are_seen(n):
    """Next to each particle of a line, two pull it apart with a thousand times what is left."""
    x, m = distributions(n)["line of equal steps"]
    x = x.astype(np.float32)
    exact = gravity.acceleration(x.astype(np.float64), m)
    a = gravity.acceleration(x, m, tolerance=1e-3, method="multipole")
    assert relative(a, exact) < 1e-3
    rough, fine, double = plans(1e-3, "newton")
    assert (rough.rough, fine.rough, double.rough) == (True, False, False)
    assert (fine.real, double.real) == (np.float32, np.float64)
    assert [p.rough for p in plans(9e-4, "newton")] == [False, False]


@pytest.mark.parametrize("rough", [True, False])
def test_pairs_are_as_wrong_as_they_say(rough):
    """Pulls of single sources at distances over six decades."""
    attract = attraction("newton", np.float32, True, rough=rough)
    n = 4000
    r = np.float32(10) ** np.random.default_rng(2).uniform(-3, 3, n).astype(np.float32)
    source, out = np.zeros((4, LANES), np.float32), np.zeros((5, n), np.float32)
    source[0, 1:], source[3, 0] = 1e6, 1.0
    target = np.zeros((3, n), np.float32)
    target[0] = r
    attract(target, n, source, LANES, (0, 0, 0), np.float32(0), out)
    wrong = -out[0] * r.astype(np.float64) ** 2 - 1
    deep = out[4] * r.astype(np.float64) - 1
    for error, part in ((wrong, 1.0), (deep, 1 / 3)):
        assert np.sqrt((error**2).mean()) < part * (1.1 * ROUGH if rough else 4e-7)
