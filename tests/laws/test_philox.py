"""Philox against its published answers, and what the engine builds from it against statistics."""

import numpy as np
import pytest

from motes.jit import jit
from motes.philox import (
    address,
    channel,
    draw,
    hash_id,
    normal_double,
    normal_single,
    philox,
    uniform_double,
    uniform_single,
)


@jit
def blocks_of(counters, keys, words):
    for i in range(words.shape[0]):
        c, k = counters[i], keys[i]
        a, b, d, e = philox(c[0], c[1], c[2], c[3], k[0], k[1])
        words[i, 0], words[i, 1], words[i, 2], words[i, 3] = a, b, d, e


@jit
def draws(seed, ids, words):
    for i in range(ids.size):
        a, b, c, d = draw(seed, ids[i], np.uint32(7), np.uint32(3))
        words[i, 0], words[i, 1], words[i, 2], words[i, 3] = a, b, c, d


@jit
def numbers(words, single, double, normals, wide_normals):
    for i in range(words.shape[0]):
        a, b, c, d = words[i, 0], words[i, 1], words[i, 2], words[i, 3]
        single[i] = uniform_single(a)
        double[i] = uniform_double(a, b)
        normals[i, 0], normals[i, 1] = normal_single(a, b)
        wide_normals[i, 0], wide_normals[i, 1] = normal_double(a, b, c, d)


@jit
def ids_of(place, ids):
    for k in range(ids.size):
        ids[k] = hash_id(place, np.uint64(k))


def philox_of(counters, keys):
    counters, keys = np.array(counters, np.uint32), np.array(keys, np.uint32)
    words = np.empty_like(counters)
    blocks_of(counters, keys, words)
    return words


def drawn(count, seed=5):
    words = np.empty((count, 4), np.uint32)
    draws(np.uint64(seed), np.arange(count, dtype=np.uint64), words)
    return words


def from_words(words):
    count = len(words)
    out = (
        np.empty(count, np.float32),
        np.empty(count),
        np.empty((count, 2), np.float32),
        np.empty((count, 2)),
    )
    numbers(words, *out)
    return out


def words_in(line):
    return [int(word, 16) for word in line.split()]


@pytest.mark.parametrize(
    ("counter", "key", "answer"),
    [
        (
            "00000000 00000000 00000000 00000000",
            "00000000 00000000",
            "6627e8d5 e169c58d bc57ac4c 9b00dbd8",
        ),
        (
            "ffffffff ffffffff ffffffff ffffffff",
            "ffffffff ffffffff",
            "408f276d 41c83b0e a20bc7c6 6d5451fd",
        ),
        (
            "243f6a88 85a308d3 13198a2e 03707344",
            "a4093822 299f31d0",
            "d16cfe09 94fdcceb 5001e420 24126ea1",
        ),
    ],
)
def test_philox_gives_the_known_answers_of_random123(counter, key, answer):
    words = philox_of([words_in(counter)], [words_in(key)])
    assert words[0].tolist() == words_in(answer)


def test_the_10000th_number_is_that_of_the_cpp26_standard():
    counters = np.zeros((2500, 4), np.uint32)
    counters[:, 0] = np.arange(2500)
    words = philox_of(counters, np.full((2500, 2), (20111115, 0)))
    assert words.ravel()[9999] == 1955073260


def test_draw_lays_out_id_channel_and_tick_in_the_counter_and_the_seed_in_the_key():
    seed, particle = 0x0123456789ABCDEF, 0xFEDCBA9876543210
    words = np.empty((1, 4), np.uint32)
    draws(np.uint64(seed), np.array([particle], np.uint64), words)
    plain = philox_of(
        [[particle & 0xFFFFFFFF, particle >> 32, 7, 3]], [[seed & 0xFFFFFFFF, seed >> 32]]
    )
    assert (words == plain).all()


def test_uniform_numbers_are_below_one_even_for_the_largest_word():
    words = np.array([[0] * 4, [0xFFFFFFFF] * 4], np.uint32)
    single, double, normals, wide_normals = from_words(words)
    assert single.tolist() == [0, 1 - 2.0**-24]
    assert double.tolist() == [0, 1 - 2.0**-53]
    assert np.isfinite(normals).all()
    assert np.isfinite(wide_normals).all()


def test_moments_are_those_of_the_distributions():
    """Sample moments lie within 5 standard errors: mean sigma / sqrt(n), and so on."""
    count = 1_000_000
    single, double, normals, wide_normals = from_words(drawn(count))
    error = 5 / np.sqrt(count)
    for u in (single.astype(float), double):
        assert abs(u.mean() - 1 / 2) < error * np.sqrt(1 / 12)
        assert abs(u.var() - 1 / 12) < error * np.sqrt(1 / 180)
    for pair in (normals.astype(float), wide_normals):
        assert (abs(pair.mean(axis=0)) < error).all()
        assert (abs((pair**2).mean(axis=0) - 1) < error * np.sqrt(2)).all()
        assert (abs((pair**3).mean(axis=0)) < error * np.sqrt(15)).all()
        assert (abs((pair**4).mean(axis=0) - 3) < error * np.sqrt(96)).all()
        assert abs((pair[:, 0] * pair[:, 1]).mean()) < error


def test_neighbouring_ids_and_the_words_of_one_draw_are_uncorrelated():
    count = 200_000
    u = drawn(count) / 2.0**32 - 0.5
    columns = np.hstack([u[:-1], u[1:]])
    correlation = np.corrcoef(columns.T) - np.eye(8)
    assert abs(correlation).max() < 5 / np.sqrt(count)


def test_ten_million_births_have_ten_million_ids():
    ids = np.empty(10_000_000, np.uint64)
    ids_of(np.uint64(address("water.emit.cone")), ids)
    ids.sort()
    assert (ids[1:] != ids[:-1]).all()


def test_births_of_different_emitters_do_not_share_ids():
    """2e6 random 64-bit numbers collide with probability 1e-7."""
    ids = np.empty((20, 100_000), np.uint64)
    for number, row in enumerate(ids):
        ids_of(np.uint64(address(f"water.emit.cone{number}")), row)
    assert np.unique(ids).size == ids.size


def test_addresses_are_the_same_numbers_on_every_machine():
    assert address("water.emit.cone") == 0xB00302C9C3A50670
    assert channel("water.emit.cone.speed") == 0x50341AE6
    assert address("é") != address("e")
