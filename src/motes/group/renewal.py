"""Lists of particles that are chosen anew from those of clusters where they do not hold any more.

Kernels decide that and do it, so that a group glides on without Python.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.group.lasting import CAUTION, SHORT, Class, Lists
from motes.interact.clusters import RADIUS, WANTED, Room
from motes.jit import STRICT, even_blocks, jit
from motes.repeat import Relay, Repeat

REACH, LISTED, MARGIN, HELD, OWNED = range(WANTED + 1, WANTED + 6)
"""Places in `bounds` [m]: the laws' reach, the radius of the lists of clusters, how far two ways
may go together, within what lists of particles hold, and whether they may be written to."""

BOUNDS = ("bounds",)
"""Name of `bounds` among the rooms of a class."""


def bounds_in(rooms: dict[Any, Any]) -> NDArray[np.float64]:
    """The bounds of a class, among its rooms."""
    if BOUNDS not in rooms:
        rooms[BOUNDS] = np.zeros(OWNED + 1)
    bounds: NDArray[np.float64] = rooms[BOUNDS]
    return bounds


@jit(flags=STRICT)
def judge(stop: Any, bounds: Any, ways: Any, number: Any) -> None:
    """Say whether shorter lists are wanted, and of which radius; stop where there are none.

    `ways`: squares of ways since lists of clusters were built, and shortened (k, 2). The same as
    `Class.good` and `Class.short_radius`, to the last bit.
    """
    moved, since, known = 0.0, 0.0, True
    for k in range(ways.shape[0]):
        moved, since = max(moved, ways[k, 0]), max(since, ways[k, 1])
        known &= (ways[k, 0] < np.inf) & (ways[k, 1] < np.inf)
    bounds[WANTED] = 0
    if known and 2 * np.sqrt(since) <= bounds[MARGIN]:
        return
    reach, listed = bounds[REACH], bounds[LISTED]
    margin = SHORT * (listed - reach)
    room = (listed - 2 * np.sqrt(moved)) * CAUTION - reach
    if known and bounds[OWNED] > 0 and room > margin / 2 and margin > 0:
        bounds[RADIUS] = reach + min(margin, room)
        bounds[WANTED] = 1
    else:
        stop[0] = number


@jit
def verify(stop: Any, bounds: Any, number: Any, state: Any, sizes: Any, longest: Any) -> None:
    """Stop where lists did not fit into their memory, or a longer one needs more to be read."""
    if bounds[WANTED] > 0:
        for k in range(sizes.size):
            if state[k, 0] < sizes[k] or state[k, 2] > longest[k]:
                stop[0] = number
            state[k, 0] = state[k, 1] = state[k, 2] = 0


@jit(flags=STRICT)
def commit(bounds: Any) -> None:
    """Lists of particles hold within another radius."""
    if bounds[WANTED] > 0:
        bounds[HELD] = bounds[RADIUS]
        bounds[MARGIN] = (bounds[RADIUS] - bounds[REACH]) * CAUTION


@jit
def mark(bounds: Any, places: Any, marks: Any, begin: Any, end: Any) -> None:
    """Keep where particles were when their lists were chosen."""
    if bounds[WANTED] > 0:
        for i in range(begin, end):
            for axis in range(4):
                marks[i, axis] = places[i, axis]


class Renewal:
    """The calls for the lists of one class, while they are in the same arrays."""

    def __init__(
        self, found: Lists, places: Mapping[str, NDArray[Any]], ways: NDArray[Any],
        rooms: dict[Any, Any], stopped: Any,
    ) -> None:  # fmt: skip
        self.bounds = bounds = bounds_in(rooms)
        self.short, self.stopped, self.ways = found.short, stopped, ways
        self._judge = Repeat(judge, (stopped, bounds, ways), [()])
        self._choose: list[Repeat] = []
        checked, self._marks = [], []
        for pair, chosen in found.short.items():
            room = rooms.get(pair)
            if not isinstance(room, Room) or room.chosen is not chosen or room.repeat is None:
                continue
            mine, theirs = places[pair[0]], places[pair[1]]
            if room.repeat.head[0] is mine and room.repeat.head[1] is theirs:
                self._choose.append(room.repeat)
                room.state.fill(0)
                sizes = np.array([one[1].size - 1 for one in room.work])
                checked.append((room.state, sizes, np.array([int(p[-1]) for p in chosen.tails])))
        for name, marks in found.marks.items():
            if rooms.get(name) is marks:
                head = bounds, places[name], marks
                self._marks.append(Repeat(mark, head, even_blocks(len(marks))))
        self._verify = Repeat(verify, (stopped, bounds), checked)
        self._commit = Repeat(commit, (bounds,), [()])
        owned = len(self._choose) == len(found.short) and len(self._marks) == len(found.marks)
        bounds[OWNED] = owned
        bounds[WANTED] = 0

    @property
    def held(self) -> float:
        """Radius within which lists of particles hold now [m]."""
        return float(self.bounds[HELD])

    def add(
        self, relay: Relay, shared: Class, found: Lists, time: float, numbers: NDArray[np.int64]
    ) -> None:
        """Append the calls, which stop the relay with the round's number (rounds, 1)."""
        self.bounds[[REACH, LISTED]] = shared.reach(time), found.radius
        self.bounds[[MARGIN, HELD]] = shared.margin(found, time), found.short_radius
        relay.add(self._judge, numbers)
        if self.bounds[OWNED] > 0:
            for calls in self._choose:
                relay.add(calls)
            relay.add(self._verify, numbers)
            relay.add(self._commit)
            for calls in self._marks:
                relay.add(calls)
