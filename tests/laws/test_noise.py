"""Laws of the noise: derivatives, divergence, continuity, statistics, and no repetition."""

import re

import numpy as np
import pytest

from motes.compile.text import executed
from motes.jit import jit
from motes.kernel.language import Translation
from motes.noise import curl, fractal_noise, noise, single_curl

pytestmark = pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")


def places(count, span=500.0, seed=0):
    return np.random.default_rng(seed).uniform(-span, span, (3, count))


def shifted(place, axis, h):
    place = place.copy()
    place[axis] += h
    return place


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def compiled(function, precision):
    """A kernel as machine code that can be called from another compiled function."""
    translation = Translation()
    name = translation.add(function, "test")
    real = {"single": np.float32, "double": np.float64}[precision]
    scope = {"F": real, "inline": jit(inline=True), **translation.types}
    scope |= {k: e.compiled(precision) for k, e in translation.elementary.items()}
    return executed("\n".join(translation.text), scope)[name]


@pytest.mark.parametrize("octaves", [None, 3.0, 2.4])
def test_the_gradient_is_the_slope_of_the_noise(octaves):
    """Central differences agree to O(h^2): a tenth of h, a hundredth of the error."""

    def field(place):
        if octaves is None:
            return noise(*place, 0.3, 7)
        return fractal_noise(*place, 0.3, octaves, 0.6, 7)

    place = places(2000)
    gradient = np.array(field(place)[1:])
    errors = []
    for h in (1e-2, 1e-3):
        slopes = [
            (field(shifted(place, i, h))[0] - field(shifted(place, i, -h))[0]) / (2 * h)
            for i in range(3)
        ]
        errors.append(rms(np.array(slopes) - gradient))
    assert errors[0] < 0.1
    assert errors[1] < errors[0] / 90


def test_curl_has_no_divergence():
    """div u by central differences is O(h^2) of the rate of strain, also with octaves."""
    place = places(2000)

    def divergence(h):
        total = 0.0
        for i in range(3):
            ahead = curl(*shifted(place, i, h), 0.3, 2.4, 0.6, 7)[i]
            behind = curl(*shifted(place, i, -h), 0.3, 2.4, 0.6, 7)[i]
            total = total + (ahead - behind) / (2 * h)
        return rms(total)

    coarse, fine = divergence(1e-2), divergence(1e-3)
    assert coarse < 0.1
    assert fine < coarse / 90


@pytest.mark.parametrize("field", [noise, single_curl])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_fields_are_continuous_across_cell_borders(field, axis):
    """The jump over 2 e across a border is at most 2 e times the slope, as e -> 0."""
    e = 1e-9
    place = places(500)
    place[axis] = np.round(place[axis])
    before = np.array(field(*shifted(place, axis, -e), 0.3, 1))
    after = np.array(field(*shifted(place, axis, e), 0.3, 1))
    assert abs(after - before).max() < 2 * e * 100


@pytest.mark.parametrize("field", [noise, single_curl])
def test_fields_and_their_rates_are_continuous_in_time(field):
    place, e = places(50), 1e-5
    t = np.linspace(0, 3, 20_001)[:, None]
    place_at_all_times = np.broadcast_to(place[:, None], (3, t.size, 50))
    series = np.array(field(*place_at_all_times, t, 1))
    step = t[1, 0]
    rate = np.diff(series, axis=1) / step
    assert abs(np.diff(rate, axis=1)).max() / step < 500
    assert abs(np.diff(series, axis=1)).max() < 100 * step
    still = rms(np.array(field(*place, 1.0 + e, 1)) - np.array(field(*place, 1.0, 1)))
    moving = rms(np.array(field(*place, 1.5 + e, 1)) - np.array(field(*place, 1.5, 1)))
    assert 0.3 < still / moving < 3


def test_root_mean_square_is_one():
    """The scales are exact means over the cell and the random vectors.

    A mean over 4e5 places of which each sees its own cell has a relative error near
    sqrt(kurtosis / 4e5) < 0.5 %.
    """
    place = places(400_000, 1e5)
    t = np.random.default_rng(1).uniform(0, 1e3, 400_000)
    assert rms(noise(*place, t, 3)[0]) == pytest.approx(1, rel=5e-3)
    assert np.sqrt(3) * rms(single_curl(*place, t, 3)) == pytest.approx(1, rel=5e-3)
    few, short = place[:, :60_000], t[:60_000]
    velocity = curl(*few, short, 3.5, 0.7, 3)
    assert np.sqrt(3) * rms(velocity) == pytest.approx(1, rel=1e-2)
    assert rms(fractal_noise(*few, short, 3.5, 0.7, 3)[0]) == pytest.approx(1, rel=2e-2)


def test_curl_prefers_no_axis():
    """Over many cells <u_i u_j> = delta_ij / 3 and <u> = 0, to 5 standard errors."""
    u = np.array(single_curl(*places(200_000, 1e4), 0.4, 3))
    error = 5 / np.sqrt(200_000)
    assert abs(np.mean(u, axis=1)).max() < error * np.sqrt(1 / 3)
    assert abs(u @ u.T / 200_000 - np.eye(3) / 3).max() < error


def test_nothing_repeats_within_a_million_cells():
    """Fields a power of two, or a small lattice vector of the hash, apart are uncorrelated."""
    place = places(4000, 100)
    here = noise(*place, 0.3, 3)[0]
    generator = np.random.default_rng(5)
    ways = [2.0**p * axis for p in range(1, 21) for axis in np.eye(3)]
    ways += list(generator.integers(-(2**20), 2**20, (40, 3)).astype(float))
    for way in ways:
        there = noise(*(place + way[:, None]), 0.3, 3)[0]
        assert abs(np.mean(here * there)) < 6 / np.sqrt(4000)


def test_seeds_and_distant_times_are_independent():
    place = places(20_000)
    here = noise(*place, 0.0, 3)[0]
    for there in (noise(*place, 0.0, 4)[0], noise(*place, 2.0, 3)[0], noise(*place, 64.0, 3)[0]):
        assert abs(np.mean(here * there)) < 6 / np.sqrt(20_000)


@pytest.mark.parametrize(("precision", "tolerance"), [("single", 2e-4), ("double", 1e-12)])
def test_compiled_noise_is_the_noise(precision, tolerance):
    """To the rounding of coordinates near 50 in each precision times the slope."""
    curl_at, noise_at = compiled(curl, precision), compiled(fractal_noise, precision)
    real = {"single": np.float32, "double": np.float64}[precision]
    octaves, roughness, seed, t = real(2.5), real(0.5), real(9), real(1.25)

    @jit
    def run(x, y, z, velocity, value):
        for i in range(x.size):
            u, v, w = curl_at(x[i], y[i], z[i], t, octaves, roughness, seed)
            velocity[0, i], velocity[1, i], velocity[2, i] = u, v, w
            n, p, q, r = noise_at(x[i], y[i], z[i], t, octaves, roughness, seed)
            value[0, i], value[1, i], value[2, i], value[3, i] = n, p, q, r

    place = places(2000, 50).astype(real)
    velocity, value = np.empty((3, 2000), real), np.empty((4, 2000), real)
    run(*place, velocity, value)
    arguments = (*place.astype(float), 1.25, 2.5, 0.5, 9)
    np.testing.assert_allclose(velocity, curl(*arguments), atol=tolerance)
    np.testing.assert_allclose(value, fractal_noise(*arguments), atol=20 * tolerance)


def test_single_precision_noise_has_no_double_and_runs_corners_side_by_side():
    curl_at = compiled(curl, "single")

    @jit
    def run(x, y, z, t, octaves, seed, out):
        for i in range(x.size):
            u, v, w = curl_at(x[i], y[i], z[i], t, octaves, t, seed)
            out[i] = u + v + w

    row, number = np.zeros(64, np.float32), np.float32(1)
    code = run.llvm(row, row, row, number, number, number, row)
    body = code[code.index("\ndefine") :].split("\n}")[0]
    assert not re.search(r"\bdouble\b", body)
    assert re.search(r"fmul .*<(4|8|16) x float>", body)
