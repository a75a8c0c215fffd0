"""The state: everything that can change the next bit of a simulation, and nothing else.

Columns are arrays of one number a particle, positions and velocities one (3, capacity) block each.
Rows move only in `Particles.keep` and `Particles.reorder`. Births need no memory: the
k-th birth of an emitter is a function of time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motes.jit import blocks, jit, share
from motes.memory import allocate
from motes.philox import hash_id

SMALLEST = 1024
"""Rows that a system starts with, and a number of which all capacities are about a multiple."""

SHIFT = 176
"""Rows more than such a multiple. Columns a power of two apart would share the same few places of
every cache, and the same banks of memory; with this shift a step is half again as fast."""


@dataclass
class Particles:
    """The particles of one system: rows 0 to count - 1 of every array are alive."""

    name: str
    real: Any
    moves: bool
    """Whether particles have a velocity of their own."""
    widths: Sequence[tuple[str, int]]
    """Addresses and widths of the columns drawn at birth."""
    remembers: int = 0
    """Numbers that a method keeps of every particle from step to step."""
    count: int = 0
    deaths: int = 0
    """How many have died so far; with the count it tells whether rows are still the same."""
    motion: NDArray[Any] = field(init=False)
    """Positions and velocities in one block, (6, capacity)."""
    position: NDArray[Any] = field(init=False)
    velocity: NDArray[Any] = field(init=False)
    birth: NDArray[np.float64] = field(init=False)
    """Scene time of birth [s]."""
    ids: NDArray[np.uint64] = field(init=False)
    columns: tuple[NDArray[Any], ...] = field(init=False)
    """Values drawn at birth, one array a component, in the order of `widths`."""

    past: NDArray[Any] = field(init=False)
    """What the method remembers, (remembers, capacity): its last row is 0 for who has no past."""

    def __post_init__(self) -> None:
        self._allocate(_roomy(SMALLEST))

    @property
    def capacity(self) -> int:
        """Rows that fit before the arrays must grow."""
        return int(self.position.shape[1])

    def _allocate(self, rows: int) -> None:
        what = f'system "{self.name}" with {rows} rows'
        self.motion = allocate((6 if self.moves else 3, rows), self.real, what)
        self.position = self.motion[:3]
        self.velocity = self.motion[3:] if self.moves else np.zeros((3, 0), self.real)
        self.birth = allocate((rows,), np.float64, what)
        self.ids = allocate((rows,), np.uint64, what)
        width = sum(w for _, w in self.widths)
        self.columns = tuple(allocate((rows,), self.real, what) for _ in range(max(width, 1)))
        self.past = allocate((self.remembers, rows), self.real, what)

    def arrays(self) -> list[NDArray[Any]]:
        """All columns as rows of numbers, in a fixed order."""
        drawn = self.columns if self.widths else ()
        velocity = list(self.velocity) if self.moves else []
        return [*self.position, *velocity, self.birth, self.ids, *drawn, *self.past]

    def reserve(self, more: int) -> None:
        """Make room for more rows; capacity doubles, and what is alive is copied."""
        if self.count + more <= self.capacity:
            return
        rows = _roomy(max(2 * self.capacity, self.count + more))
        old = self.arrays()
        self._allocate(rows)
        for before, after in zip(old, self.arrays(), strict=True):
            after[: self.count] = before[: self.count]

    def forget(self, rows: slice | NDArray[np.int64]) -> None:
        """Give rows no past: they are new, or something happened to them within a step."""
        if self.remembers:
            self.past[-1, rows] = 0

    def append(
        self, position: NDArray[Any], velocity: NDArray[Any], birth: float, address: np.uint64
    ) -> None:
        """Add rows (3, n), born at a time [s], whose ids hang on an address and their number."""
        more, first = position.shape[1], self.count
        self.reserve(more)
        new = slice(first, first + more)
        self.position[:, new] = position
        if self.moves:
            self.velocity[:, new] = velocity
        self.birth[new] = birth
        self.forget(new)
        _name(address, first, self.ids[new])
        self.count += more

    def keep(self, dead: NDArray[np.uint8]) -> int:
        """Close the gaps of the rows marked dead, in order; returns how many went."""
        first = int(np.argmax(dead[: self.count].view(bool))) if self.count else 0
        if self.count == 0 or not dead[first]:
            return 0
        arrays = self.arrays()
        share(lambda k: _compact(arrays[k], dead, first, self.count), len(arrays))
        gone = int(np.count_nonzero(dead[: self.count]))
        self.count -= gone
        self.deaths += gone
        return gone

    def reorder(self, order: NDArray[np.int32], also: Iterable[NDArray[Any]] = ()) -> None:
        """Move rows: row k becomes what row `order[k]` was, for the first of the rows, and in other
        arrays that go with them."""
        arrays = [*self.arrays(), *also]
        share(lambda k: _move(arrays[k], order, np.empty(order.size, arrays[k].dtype)), len(arrays))

    def first_not_finite(self) -> int | None:
        """The first row whose position or velocity is infinite or not a number, or None."""
        parts = blocks(self.count, 1 << 16)
        found = [self.count] * len(parts)
        velocity = self.velocity if self.moves else self.position

        def search(k: int) -> None:
            low, high = parts[k]
            first = _first_not_finite(self.position, velocity, low, high)
            found[k] = first if first < high else self.count

        share(search, len(parts))
        first = min(found, default=self.count)
        return first if first < self.count else None

    def copy(self) -> Particles:
        """An independent copy of the rows that are alive, with room for births."""
        twin = object.__new__(Particles)
        twin.__dict__.update(self.__dict__)
        twin._allocate(_roomy(self.count + self.count // 8))
        for mine, theirs in zip(self.arrays(), twin.arrays(), strict=True):
            theirs[: self.count] = mine[: self.count]
        return twin


class Memory(Protocol):
    """What a group keeps: a copy shares arrays, which are replaced and never written to."""

    def copy(self) -> Memory:
        """An independent copy."""

    def arrays(self) -> Iterator[NDArray[Any]]:
        """Everything in it that can change the next bit."""


@dataclass
class State:
    """Step number and particles; the time is start + step * number, never a sum."""

    number: int
    systems: dict[str, Particles]
    memories: list[Memory] = field(default_factory=list)
    """What each group of systems that interact keeps from step to step."""

    def copy(self) -> State:
        """An independent copy."""
        systems = {name: p.copy() for name, p in self.systems.items()}
        return State(self.number, systems, [memory.copy() for memory in self.memories])

    def digest(self) -> str:
        """One hash of the whole state, of 32 hexadecimal digits."""
        total = hashlib.blake2b(str(self.number).encode(), digest_size=16)
        for name, particles in sorted(self.systems.items()):
            total.update(f"{name} {particles.count} {particles.widths}".encode())
            for array in particles.arrays():
                total.update(np.ascontiguousarray(array[: particles.count]).data)
        for memory in self.memories:
            for array in memory.arrays():
                total.update(np.ascontiguousarray(array).data)
        return total.hexdigest()


def _roomy(rows: int) -> int:
    """A capacity of at least so many rows."""
    return -(-rows // SMALLEST) * SMALLEST + SHIFT


@jit
def _name(address, first, ids):  # type: ignore[no-untyped-def]
    """Ids of births from a number on."""
    for i in range(ids.size):
        ids[i] = hash_id(address, np.uint64(first + i))


@jit
def _move(array, order, room):  # type: ignore[no-untyped-def]
    """Give the first elements of an array another order, by way of a room as long."""
    for i in range(order.size):
        room[i] = array[np.uint64(order[i])]
    array[: order.size] = room


@jit
def _compact(array, dead, first, count):  # type: ignore[no-untyped-def]
    """Move the rows that live down over those that died, in order."""
    free = first
    for i in range(first, count):
        if dead[i] == 0:
            array[free] = array[i]
            free += 1


@jit
def _first_not_finite(position, velocity, low, high):  # type: ignore[no-untyped-def]
    """Index of the first column with an element that is infinite or not a number, or `high`."""
    x, y, z = position[0][low:high], position[1][low:high], position[2][low:high]
    vx, vy, vz = velocity[0][low:high], velocity[1][low:high], velocity[2][low:high]
    none = x[0] * 0
    for i in range(x.size):  # A sum is SIMD, a search is not; 0 times infinity is no number.
        none += (x[i] + y[i] + z[i]) * 0 + (vx[i] + vy[i] + vz[i]) * 0
    if none != 0:
        for i in range(x.size):
            place = (abs(x[i]) < np.inf) & (abs(y[i]) < np.inf) & (abs(z[i]) < np.inf)
            motion = (abs(vx[i]) < np.inf) & (abs(vy[i]) < np.inf) & (abs(vz[i]) < np.inf)
            if not (place & motion):
                return low + i
    return high
