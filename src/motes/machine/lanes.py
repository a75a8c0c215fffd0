"""Several numbers at once: what a kernel calls to work on neighbours in an array together.

A kernel that is written for one number works on lanes as it stands: an operation on lanes and a
single number takes that number for every lane, and a choice picks lane by lane. Where plain Python
runs a kernel, there is one lane.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def take(array: Any, place: Any, lanes: int) -> Any:
    """Elements of an array of one axis, from `place` on, one for each of `lanes` (a literal)."""
    if lanes != 1:
        raise ValueError(f"plain Python has one lane, not {lanes}")
    return array[place]


def put(array: Any, place: Any, value: Any) -> None:
    """Write what `take` could have given, or one number, to an array from `place` on."""
    array[place] = value


def bits(condition: Any) -> Any:
    """A condition's lanes as the bits of an unsigned integer, the first lane the lowest."""
    return np.uint64(bool(condition))


def lowest(number: Any) -> Any:
    """Place of the lowest bit of an unsigned integer of 64 bits that is not 0."""
    whole = int(number)
    return np.uint64((whole & -whole).bit_length() - 1)


def settled(value: Any) -> Any:
    """A number that is to be computed first, and not taken apart to be computed otherwise."""
    return value


def count(marks: Any) -> Any:
    """How many bits of an unsigned integer are set."""
    return np.uint64(int(marks).bit_count())


def pack(array: Any, place: Any, value: Any, marks: Any) -> None:
    """Write the lanes of a value whose bits in `marks` are set one after another, from `place` on.

    As many elements as there are lanes may change.
    """
    array[place] = value
