"""Several numbers at once: what a kernel calls to work on neighbours in an array together.

A kernel that is written for one number works on lanes as it stands: an operation on lanes and a
single number takes that number for every lane, and a choice picks lane by lane. Where plain Python
runs a kernel, one lane is a number, and several are an array.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def take(array: Any, place: Any, lanes: int) -> Any:
    """Elements of an array of one axis, from `place` on, one for each of `lanes` (a literal).

    A kernel reads on past the end, where its memory has to go on; plain Python takes zeros there.
    """
    if lanes == 1:
        return array[place]
    found, some = np.zeros(lanes, array.dtype), array[place : place + lanes]
    found[: len(some)] = some
    return found


def put(array: Any, place: Any, value: Any) -> None:
    """Write what `take` could have given, or one number, to an array from `place` on."""
    if np.ndim(value):
        array[place : place + len(value)] = value
    else:
        array[place] = value


def fetch(array: Any, place: Any) -> None:
    """Say that elements of an array from a place on, or about there, are read soon."""


def streams() -> None:
    """Say of a kernel that it goes through arrays which are too long to be in a cache."""


def spread_over(value: Any, lanes: int) -> Any:
    """A number in every one of `lanes` (a literal)."""
    return value if lanes == 1 else np.full(lanes, value)


def bits(condition: Any) -> Any:
    """A condition's lanes as the bits of an unsigned integer, the first lane the lowest."""
    return np.uint64(sum(1 << k for k, true in enumerate(np.ravel(condition)) if true))


def lowest(number: Any) -> Any:
    """Place of the lowest bit of an unsigned integer of 64 bits that is not 0."""
    whole = int(number)
    return np.uint64((whole & -whole).bit_length() - 1)


def settled(value: Any) -> Any:
    """A number that is to be computed first, and not taken apart to be computed otherwise."""
    return value


def choose(condition: Any, one: Any, other: Any) -> Any:
    """`one` where a condition holds, `other` where not, lane by lane."""
    return np.where(condition, one, other)


def total(lanes: Any) -> Any:
    """Sum over the lanes, by halves."""
    return lanes.sum()


def largest(lanes: Any) -> Any:
    """Largest lane."""
    return lanes.max()


def rough_inverse_root(value: Any) -> Any:
    """1 / root in single precision, to 11 bits or better."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.float32(1) / np.sqrt(value)


def put_some(array: Any, place: Any, value: Any, condition: Any) -> int:
    """Write the lanes where a condition holds to an array, one after another.

    Returns how many there are; as many numbers as there are lanes may change, from `place` on.
    """
    some = np.atleast_1d(value)[np.atleast_1d(condition)]
    array[place : place + len(some)] = some
    return len(some)
