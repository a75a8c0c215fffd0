"""Noise against its definition, written with Python's own integers and the potential itself."""

import math
from itertools import product

import numpy as np
import pytest

from motes.noise import CURL_SCALE, NOISE_SCALE, noise, single_curl

WORD = 0xFFFFFFFF


def chained(h, i):
    h = (h ^ (i & WORD)) * 0x9E3779B1 & WORD
    return h ^ h >> 15


def mixed(h):
    h = (h ^ h >> 16) * 0x7FEB352D & WORD
    h = (h ^ h >> 15) * 0x846CA68B & WORD
    return h ^ h >> 16


def fade(u):
    return 6 * u**5 - 15 * u**4 + 10 * u**3


def vector(h):
    return np.array([(h >> shift) % 1024 - 511.5 for shift in (22, 12, 2)]) / 512


def terms(place, t, seed):
    """Weight, way from the point and random vector of the eight lattice points about a place."""
    cell = [math.floor(x) for x in place]
    for corner in product((0, 1), repeat=3):
        point = [i + bit for i, bit in zip(cell, corner, strict=True)]
        h = mixed(seed)
        for coordinate in point:
            h = chained(h, coordinate)
        way = np.array(place) - point
        weight = math.prod(1 - fade(abs(d)) for d in way)
        local = t + (h >> 8) / 2**24
        tick = math.floor(local)
        share = fade(local - tick)
        old, new = (vector(mixed(chained(h, k))) for k in (tick, tick + 1))
        yield weight, way, (1 - share) * old + share * new


def plain_noise(place, t, seed):
    return NOISE_SCALE * sum(weight * g @ way for weight, way, g in terms(place, t, seed))


def plain_potential(place, t, seed):
    return CURL_SCALE * sum(w * np.cross(g, way) / 2 for w, way, g in terms(place, t, seed))


def slopes(field, place):
    """Central differences d field / d x_i along the first axis, fourth order."""
    h = 1e-3
    result = []
    for axis in np.eye(3) * h:
        near = field(place + axis) - field(place - axis)
        far = field(place + 2 * axis) - field(place - 2 * axis)
        result.append((8 * near - far) / (12 * h))
    return np.array(result)


PLACES = np.random.default_rng(4).uniform(-50, 50, (20, 3))


@pytest.mark.parametrize("seed", [0, 12345])
def test_noise_is_its_definition_and_its_gradient(seed):
    for number, place in enumerate(PLACES):
        t = 0.7 * number - 3
        with np.errstate(over="ignore"):
            value, *gradient = noise(*place, t, seed)
        assert value == pytest.approx(plain_noise(place, t, seed), abs=1e-12)
        expected = slopes(lambda x, t=t: plain_noise(x, t, seed), place)
        np.testing.assert_allclose(gradient, expected, atol=1e-8)


@pytest.mark.parametrize("seed", [0, 12345])
def test_curl_is_the_curl_of_the_potential(seed):
    for number, place in enumerate(PLACES):
        t = 0.7 * number - 3
        with np.errstate(over="ignore"):
            velocity = single_curl(*place, t, seed)
        d = slopes(lambda x, t=t: plain_potential(x, t, seed), place)
        expected = [d[1, 2] - d[2, 1], d[2, 0] - d[0, 2], d[0, 1] - d[1, 0]]
        np.testing.assert_allclose(velocity, expected, atol=1e-8)
