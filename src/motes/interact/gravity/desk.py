"""What the walk over the tree may neglect, and its working memory."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.expansions import ROOM, places
from motes.interact.gravity.lanes import LANES
from motes.interact.gravity.morton import LEVELS
from motes.interact.gravity.translations import FAMILY, Translations, padded, width
from motes.memory import allocate

SOURCES = {False: 1536, True: 1024}
"""Sources that are packed for one sum over pairs, of four numbers or of seven with coordinates in
two parts: in single precision they fit the first cache."""

_STACK = 8 * LANES * (LEVELS + 2) + LANES


class Limits(NamedTuple):
    """What the walk may neglect, and the pair law's lengths."""

    opening2: float
    """Square of the largest (r_A + r_B) / R at which expansions are used."""
    error: float
    """Largest estimated error of the acceleration by one use of an expansion."""
    easier: float
    """How many times less may be neglected where the lower order is used."""
    force: float
    """Largest estimated error of that times the mass of the target cell: of its momentum."""
    alike: float
    """Largest estimated error of that times the root of the number of targets that share it."""
    rounding: float
    """Largest error of the acceleration by rounded coordinates in one sum over pairs."""
    rough: bool
    """Whether pairs may be wrong by `softening.ROUGH`, in single precision."""
    few: int
    """Two leaves with a product of numbers of particles up to this are summed by pairs."""
    size: float
    """Length in the pair law: Plummer's softening, or the spline's support."""
    reach: float
    """Distance under which the pair law is not that of the expansions."""
    e2: float
    """Square of the softening in the expansions."""


class Desk(NamedTuple):
    """Working memory of one walk."""

    place: NDArray[Any]
    """(5, width) what `Translations` take: coordinates, a factor, and a radius."""
    children: NDArray[Any]
    """(5, FAMILY) the same of a cell's children."""
    chosen: NDArray[np.int32]
    """(lanes,) source cells that are tested together."""
    ascending: NDArray[np.int32]
    """(lanes,) 0, 1, 2 ..."""
    far: NDArray[np.int32]
    """(2, 3 lanes) source cells whose expansions are to be used, in full and of the lower order."""
    candidates: NDArray[np.int32]
    """Source cells that are left for a target cell's children, lists of all levels end to end."""
    reaches: NDArray[np.float64]
    """How far each of the last list, of a leaf, reaches from its center."""
    waiting: NDArray[np.int32]
    """(stack, 3) target cells, and where the lists that they inherit begin and end."""
    opened: NDArray[np.int32]
    """(stack,) source cells to test."""
    local: NDArray[Any]
    """(stack, padded basis) local terms of waiting target cells."""
    places: NDArray[np.int32]
    """Rows of `room` that moments are multiplied by."""
    room: NDArray[Any]
    """(ROOM, width) what `moments_to_local` needs room for."""
    high_room: NDArray[np.float32]
    """(ROOM, lanes) the same in single precision, for products of high degree."""
    high: NDArray[np.float32]
    """(basis, lanes) what these add to local terms."""
    gathered: NDArray[Any]
    """(basis, width) local terms being summed."""
    target: NDArray[Any]
    """(6, largest leaf) targets as the pair law sees them, coordinates in one part or two."""
    source: NDArray[Any]
    """(7, SOURCES + lanes) packed sources: x, y, z, m, and second parts of coordinates."""
    spans: NDArray[np.int32]
    """(SOURCES, 2) which particles they are."""
    part: NDArray[Any]
    """(5, largest leaf) sums over packed sources."""
    total: NDArray[Any]
    """(5, largest leaf) sums over all sources."""


def desk(
    operations: Translations, harmonic: bool, real: type, mixed: bool, largest: int, capacity: int
) -> Desk:
    """Working memory for target leaves of at most `largest` and `capacity` candidates."""
    pairs = np.float32 if mixed else real
    columns, lanes = -(-largest // LANES) * LANES, width(real)
    return Desk(
        place=np.ones((5, lanes), real),
        children=np.ones((5, FAMILY), real),
        chosen=np.zeros(LANES, np.int32),
        ascending=np.arange(LANES, dtype=np.int32),
        far=np.zeros((2, 3 * LANES), np.int32),
        candidates=np.empty(capacity, np.int32),
        reaches=np.empty(capacity),
        waiting=np.empty((_STACK, 3), np.int32),
        opened=np.zeros(_STACK, np.int32),
        local=np.zeros((_STACK, padded(operations.basis)), real),
        places=np.array(places(harmonic), np.int32),
        room=allocate((ROOM, lanes), real, "expansions"),
        high_room=allocate((ROOM if mixed else 0, LANES), np.float32, "expansions"),
        high=allocate((operations.basis if mixed else 0, LANES), np.float32, "expansions"),
        gathered=allocate((operations.basis, lanes), real, "expansions"),
        target=np.zeros((6, columns), pairs),
        source=np.zeros((7, SOURCES[mixed] + LANES), pairs),
        spans=np.empty((SOURCES[mixed], 2), np.int32),
        part=np.zeros((5, columns), real),
        total=np.zeros((5, columns), real),
    )
