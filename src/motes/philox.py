"""Random numbers as a function: Philox4x32-10 of who asks, for what, and when.

draw = philox(key = seed, counter = (id, channel, tick)). A particle's numbers depend on nothing
else: not on order, threads, machines, or what the rest of the scene does. Source: Salmon, Moraes,
Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.

All arithmetic is on explicit uint32 and uint64; a plain integer in compiled code would be int64,
with wrong answers.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.jit import EXACT, jit
from motes.kernel import cos, log, sin

MULTIPLIER_0 = np.uint64(0xD2511F53)
MULTIPLIER_1 = np.uint64(0xCD9E8D57)
WEYL_0 = np.uint32(0x9E3779B9)
WEYL_1 = np.uint32(0xBB67AE85)
HALF_WORD = np.uint64(32)

_log_single, _sin_single, _cos_single = (f.compiled("single") for f in (log, sin, cos))
_log_double, _sin_double, _cos_double = (f.compiled("double") for f in (log, sin, cos))


def address(text: str) -> int:
    """64-bit number of an address such as "water.emit.cone": blake2b of its UTF-8 bytes."""
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "little")


def channel(text: str) -> int:
    """32-bit number of a parameter's address: blake2b of its UTF-8 bytes."""
    return int.from_bytes(blake2b(text.encode(), digest_size=4).digest(), "little")


@jit(flags=EXACT, inline=True)
def _round(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> Any:
    first = MULTIPLIER_0 * np.uint64(c0)
    second = MULTIPLIER_1 * np.uint64(c2)
    return (
        np.uint32(second >> HALF_WORD) ^ c1 ^ k0,
        np.uint32(second),
        np.uint32(first >> HALF_WORD) ^ c3 ^ k1,
        np.uint32(first),
    )


@jit(flags=EXACT, inline=True)
def philox(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> Any:
    """Four random uint32 for a counter of four uint32 and a key of two."""
    for _ in range(10):
        c0, c1, c2, c3 = _round(c0, c1, c2, c3, k0, k1)
        k0 = np.uint32(k0 + WEYL_0)
        k1 = np.uint32(k1 + WEYL_1)
    return c0, c1, c2, c3


@jit(flags=EXACT, inline=True)
def draw(seed: Any, id: Any, channel: Any, tick: Any) -> Any:
    """Four random uint32 for a particle, a channel and a tick of time.

    `seed` and `id` are uint64, `channel` and `tick` uint32; a birth's tick is 0.
    """
    return philox(
        np.uint32(id),
        np.uint32(id >> HALF_WORD),
        channel,
        tick,
        np.uint32(seed),
        np.uint32(seed >> HALF_WORD),
    )


@jit(flags=EXACT, inline=True)
def uniform_single(word: Any) -> Any:
    """Float32 in [0, 1), a multiple of 2^-24, from the top bits of a uint32."""
    return np.float32(np.int32(word >> np.uint32(8))) * np.float32(2.0**-24)


@jit(flags=EXACT, inline=True)
def uniform_double(high: Any, low: Any) -> Any:
    """Float64 in [0, 1), a multiple of 2^-53, from the top bits of two uint32."""
    bits = (np.uint64(high) << HALF_WORD | np.uint64(low)) >> np.uint64(11)
    return np.float64(np.int64(bits)) * np.float64(2.0**-53)


@jit(flags=EXACT, inline=True)
def normal_single(first: Any, second: Any) -> Any:
    """Two independent float32 from the standard normal distribution, from two uint32.

    Box and Muller: sqrt(-2 ln(1 - u)) (cos 2 pi v, sin 2 pi v). At most 5.8 from 0, since u has
    24 bits.
    """
    radius = np.sqrt(np.float32(-2) * _log_single(np.float32(1) - uniform_single(first)))
    angle = np.float32(2 * np.pi) * uniform_single(second)
    return radius * _cos_single(angle), radius * _sin_single(angle)


@jit(flags=EXACT, inline=True)
def normal_double(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Two independent float64 from the standard normal distribution, from four uint32.

    As `normal_single`, at most 8.6 from 0.
    """
    radius = np.sqrt(np.float64(-2) * _log_double(np.float64(1) - uniform_double(a, b)))
    angle = np.float64(2 * np.pi) * uniform_double(c, d)
    return radius * _cos_double(angle), radius * _sin_double(angle)


@jit(flags=EXACT, inline=True)
def hash_id(address: Any, k: Any) -> Any:
    """Id (uint64) of the k-th birth (uint64) at an address or of a parent (uint64).

    For one address, different k give different ids: each step is a bijection of 64-bit numbers
    (the mixing is MurmurHash3's finalizer with Stafford's constants, variant 13).
    """
    x = address ^ _mixed(k * np.uint64(0x9E3779B97F4A7C15) + np.uint64(1))
    return _mixed(x)


def birth_number(address: int, ids: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The k of `hash_id(address, k)`: its inverse, a large number where ids are of others."""
    with np.errstate(over="ignore"):
        x = _unmixed(_unmixed(ids) ^ np.uint64(address)) - np.uint64(1)
        return np.asarray(x * np.uint64(pow(0x9E3779B97F4A7C15, -1, 1 << 64)))


def _unmixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Inverse of `_mixed`: its steps backwards, each shift as often as it takes to pass 64 bits."""
    for shift, factor in ((31, 0x94D049BB133111EB), (27, 0xBF58476D1CE4E5B9), (30, 1)):
        x = x ^ (x >> np.uint64(shift))
        x = (x ^ (x >> np.uint64(2 * shift))) * np.uint64(pow(factor, -1, 1 << 64))
    return x


@jit(flags=EXACT, inline=True)
def _mixed(x: Any) -> Any:
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
