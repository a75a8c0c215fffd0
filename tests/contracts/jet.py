"""A jet of water without an engine; as a program it keeps frames of it until it is killed."""

from __future__ import annotations

import sys

import numpy as np

from motes.frame import Frame
from motes.record.frames import FrameStore, Manifest

MANIFEST = Manifest("jet", {"title": "Jet"}, "d1", 24.0, "0.1.0")


def jet(index: int = 1, rows: int = 100) -> Frame:
    """Frame `index`, the same in every process."""
    numbers = np.random.default_rng(index)
    columns = {
        "position": numbers.normal(size=(3, rows)).astype(np.float32).T,
        "velocity": numbers.normal(size=(rows, 3)).astype(np.float32),
        "color": numbers.random((rows, 4)).astype(np.float32),
        "size": numbers.random(rows).astype(np.float32),
        "age": numbers.random(rows).astype(np.float32),
        "id": numbers.integers(0, 2**64, rows, dtype=np.uint64),
    }
    return Frame(time=index / 24, index=index, systems={"water": columns})


if __name__ == "__main__":
    store = FrameStore.create(sys.argv[1], MANIFEST)
    begin = max(store.numbers(), default=0)
    print("ready", flush=True)
    for number in range(begin + 1, begin + 100_000):
        store.write(jet(number, rows=3000))
