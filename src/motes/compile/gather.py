"""Gathering laws in one loop: several laws' sums over neighbours that cells give at once.

Lists of neighbours pay while particles move little in a step. What flies a good part of its reach
in a step needs others each time; then it is quicker to meet all that are in the cells around. Eight
targets, next to one another, are the lanes of vectors, and meet one source after another. So there
is nothing to choose, to copy or to add up across lanes, whatever the laws say.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.compile.pairs import FROM_SQUARE, Law, Writer
from motes.compile.text import AXES, Text
from motes.control.constant import Constant, Setting
from motes.errors import SceneError
from motes.interact.cells import Cells, Grid
from motes.interact.runs import SHORT, chooser, runs_near
from motes.jit import EXACT, STRICT, bound, jit
from motes.machine.lanes import choose, fetch, put, rough_inverse_root, settled, take

LANES = 8
"""Targets that meet sources together; columns of targets go on for as many beyond the last."""

CAUTION = 1e-6
"""Share of the reach's square by which rounding may move a box: more than it does."""

LEAST = 1e-30
"""Square of the least distance [m2]; those at the very same place are as far apart."""

AHEAD = 8
"""Points beyond a run that are fetched: the next targets, along the same row, are near them."""

WIDE = 2.5
"""Reaches along x within which targets that meet sources together are."""


class Gathering:
    """Several laws' sums over the same sources: a kernel and the numbers that it reads."""

    def __init__(self, laws: Sequence[Law]) -> None:
        # Few sums first: with that order of the three rules of flocks the loop is 58 instructions
        # long, with others 76 to 78, since LLVM moves sums from register to register.
        self.laws = sorted(laws, key=lambda law: law.sums())
        self.own, self.other = _read(self.laws, 0), _read(self.laws, 1)
        self.sums = sum(law.sums() for law in laws)
        self._places: dict[Any, int] = {}
        """Where each number is. What never changes and is the same in two laws is one number, and
        what follows from it is computed once."""
        self._of_laws = [self._places_of(law) for law in self.laws]
        self._kernel: Callable[..., Any] | None = None

    def _places_of(self, law: Law) -> list[int]:
        """Places of a law's reach and of its numbers."""
        lasts = all(isinstance(c, Setting | Constant) for c in law.part.values.values())
        found = []
        for k, value in enumerate(_values(law, 0.0)):
            key = float(value) if lasts else (law.address, k)
            found.append(self._places.setdefault(key, len(self._places)))
        return found

    def numbers(self, time: float, real: type) -> NDArray[Any]:
        """All numbers at a time, as the kernel reads them."""
        found: NDArray[Any] = np.empty(len(self._places), real)
        for law, places in zip(self.laws, self._of_laws, strict=True):
            found[places] = _values(law, time)
        return found

    def prepare(self, real: type) -> None:
        """Compile, or see that the kernel cache has it, without any particles."""
        some: NDArray[Any] = np.zeros(1, real)
        three: NDArray[Any] = np.zeros((3, 1), real)
        rows = np.zeros(1, np.int32)
        whole = np.ones(3, np.int64)
        cut = Grid(np.zeros(3), np.ones(3), whole, whole < 0, np.ones(3, real))
        cells = Cells(three, rows, np.zeros(1, np.uint64), rows, np.uint64(0))
        self._tried(
            self.numbers(0.0, real), (some,) * len(self.own), rows, cells.key, 1,
            (some,) * len(self.other), cut, cells, rows, False, True,
            np.zeros((self.sums, 0), real), rows, three, np.zeros((1, 2), np.int64),
        )  # fmt: skip

    def bound(self, *arguments: Any) -> Callable[..., Any]:
        """A function of a part that adds accelerations to pushes; see `_text`.

        Where a law's kernel is beyond what works on lanes, targets come one after another.
        """
        if self._kernel is None:
            self._kernel = self._tried(*arguments)
        return bound(self._kernel, *arguments)

    def _tried(self, *arguments: Any) -> Callable[..., Any]:
        """The kernel that compiles, tried with no targets."""
        plain = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
        kernel = self._text(1 if plain else LANES)
        try:
            kernel(*arguments, 1, 0, 0, 0)
        except SceneError:
            kernel = self._text(1)
        return kernel

    def _text(self, lanes: int) -> Callable[..., Any]:
        """The kernel that adds what follows from the sums of all laws to the targets' pushes.

        It serves targets from `begin` to `end`, with room for so many points near a few of them,
        and writes into `state[part]` the first that there is not enough room for, and how much it
        needs. Where the laws have several sources, a kernel call for each, the sums are `kept` in
        between: a call that `goes_on` begins with them, only the last `ends`.
        """
        text = Text(self.laws[0].precision, self.laws[0].strict)
        prelude, body, start, keep, end, place = "", "", "", "", "", 0
        reaches: dict[int, str] = {}
        for i, (law, places) in enumerate(zip(self.laws, self._of_laws, strict=True)):
            writer, reach = Writer(text, law), places[0]
            p = re.sub(r"numbers\[(\d+)\]", lambda m: f"n{places[1 + int(m[1])]}", writer.p())  # noqa: B023
            prelude += f"    p{i} = {p}\n"
            if reach not in reaches:
                reaches[reach] = f"n{reach}"
                prelude += f"    limit{reach} = n{reach} * n{reach}\n"
                # Who does not count is taken at the reach, where laws are finite, and times 0.
                body += (
                    f"                near = (square <= limit{reach}) & other\n"
                    f"                weight{reach} = F(1.0) if near else F(0.0)\n"
                    f"                square{reach} = min(square, limit{reach})\n"
                    f"                length{reach} = min(length, n{reach})\n"
                )
            call = writer.call("near").replace("(p, ", f"(p{i}, ", 1)
            call = call.replace(FROM_SQUARE, f"square{reach}, length{reach}, inverse")
            width = range(place, place + law.sums())
            place += law.sums()
            body += f"                {''.join(f'm{k}, ' for k in width)} = {call}\n"
            for k in width:
                start += f"        sum{k} = take(kept[{k}], i, {lanes}) if goes_on else F(0.0)\n"
                body += f"                sum{k} += weight{reach} * m{k}\n"
                keep += f"            put(hold[{k}], 0, sum{k})\n"
            sums = "".join(f"sum{k}, " for k in width)
            a = writer.particle("A", law.fields[0], "a_")
            given = f"{writer.translated('acceleration')}(p{i}, {a}, ({sums}))"
            end += f"            fx, fy, fz = {given}\n"
            end += "            px, py, pz = px + fx, py + fy, pz + fz\n"
        numbers = "".join(f"    n{k} = numbers[{k}]\n" for k in range(len(self._places)))
        most = list(reaches.values())
        widest = f"max({', '.join(most)})" if len(most) > 1 else most[0]
        lines = (
            "@kernel\ndef gather(numbers, targets, slot, key, along, sources, grid, cells, "
            "begin, end, run, shift, block, ramp, pick, spots, hold, goes_on, ends, kept, order, "
            "push):\n"
            f"{numbers}{prelude}    reach = {widest}\n"
            f"    limit, wide = reach * reach * F({1 + CAUTION}), reach * F({WIDE})\n"
        )
        lines += "".join(f"    t_{n} = targets[{k}]\n" for k, n in enumerate(self.own))
        lines += "".join(f"    s_{n} = sources[{k}]\n" for k, n in enumerate(self.other))
        lines += (
            "    i = begin\n    while i < end:\n"
            f"        stop = same_row(i, end, key, uint64(along), t_x, wide, {lanes})\n"
            "        low, high = bounds(t_x, t_y, t_z, i, stop)\n"
            "        number, points = runs_near(low, high, reach, grid, cells, run, shift)\n"
            f"        if number > run.shape[0] or points > pick.size - {lanes}:\n"
            "            return i, max(number, points)\n"
            "        for r in range(number):\n            k = run[r, 1] + ahead\n"
        )
        lines += "".join(f"            fetch(s_{n}, k)\n" for n in self.other)
        lines += (
            f"        for e in range({lanes}):\n"
            "            k = i + e if i + e < stop else i\n"
            "            spots[0, e], spots[1, e], spots[2, e] = t_x[k], t_y[k], t_z[k]\n"
            f"        me = take(slot, i, {lanes})\n"
        )
        lines += "".join(f"        a_{n} = take(t_{n}, i, {lanes})\n" for n in self.own)
        lines += start + "        r = 0\n        while r < number:\n"
        lines += (
            "            dx, dy, dz = shift[r, 0], shift[r, 1], shift[r, 2]\n"
            "            places = (s_x, s_y, s_z)\n"
            "            r, held = choose(places, spots, limit, r, number, run, shift, block, "
            "ramp, pick)\n"
        )
        lines += "".join(f"            o_{n} = settled(a_{n} - d{n})\n" for n in AXES)
        lines += "            for e in range(held):\n                k = pick[e]\n"
        lines += "".join(f"                b_{n} = s_{n}[k]\n" for n in self.other)
        lines += (
            "                rx, ry, rz = o_x - b_x, o_y - b_y, o_z - b_z\n"
            "                square = rx * rx + ry * ry + rz * rz\n"
            "                length, inverse = lengths(square)\n"
            "                other = me != int32(k)\n"
        )
        lines += body
        lines += (
            "        if ends:\n            px, py, pz = F(0.0), F(0.0), F(0.0)\n"
            f"{end}            put(hold[0], 0, px)\n            put(hold[1], 0, py)\n"
            "            put(hold[2], 0, pz)\n"
            "            for e in range(stop - i):\n                row = order[i + e]\n"
            "                for n in range(3):\n"
            "                    push[n, row] += hold[n, e]\n"
            f"        else:\n{keep}"
            "            for e in range(stop - i):\n"
            "                for n in range(kept.shape[0]):\n"
            "                    kept[n, i + e] = hold[n, e]\n"
            "        i = stop\n    return end, 0\n"
        )
        lines += (
            "@kernel\ndef gather_part(numbers, targets, slot, key, along, sources, grid, cells, "
            "ramp, goes_on, ends, kept, order, push, state, room, part, begin, end):\n"
            "    run, shift = empty((room, 2), int64), empty((room, 3), F)\n"
            f"    pick = empty(room + {lanes}, int32)\n"
            f"    block = empty((2 * room + {SHORT}, 2), int32)\n"
            f"    spots = empty((3, {lanes}), F)\n"
            f"    hold = empty(({max(self.sums, 3)}, {lanes}), F)\n"
            "    state[part, 0], state[part, 1] = gather(numbers, targets, slot, key, along, "
            "sources, grid, cells, begin, end, run, shift, block, ramp, pick, spots, hold, "
            "goes_on, ends, kept, order, push)\n"
        )
        text.add(lines)
        extra = {
            "int32": np.int32,
            "int64": np.int64,
            "uint32": np.uint32,
            "uint64": np.uint64,
            "take": take,
            "put": put,
            "fetch": fetch,
            "ahead": np.int64(AHEAD),
        }
        extra |= {"runs_near": runs_near, "same_row": _same_row, "bounds": _bounds}
        extra |= {"choose": chooser(lanes), "settled": settled}
        extra |= {"lengths": _lengths(text.real, text.strict)}
        found: Callable[..., Any] = text.module(extra)["gather_part"]
        return found


def _read(laws: Sequence[Law], which: int) -> tuple[str, ...]:
    """Fields that laws read of a target (0) or a source (1), place first."""
    names = {name for law in laws for name in law.fields[which]}
    return (*AXES, *sorted(names - set(AXES)))


def _values(law: Law, time: float) -> list[float]:
    return [law.reach(time), *law.numbers(time, np.float64)]


@cache
def _lengths(real: type, strict: bool) -> Callable[..., Any]:
    """Kernel: from a distance's square to the distance and 1 / distance, finite also at none.

    In single precision both come from an estimate of 1 / distance, wrong by a few 1e-4, and one
    step of Newton's method, wrong by 2e-7: a root and a division take as long as all the rest of
    three rules of flocks.
    """
    least, one, half, more = real(LEAST), real(1), real(0.5), real(1.5)

    @jit(inline=True, flags=EXACT)
    def quick(square: Any) -> Any:
        square = choose(square > least, square, least)
        y = rough_inverse_root(square)
        y = y * (more - (half * square) * (y * y))
        return square * y, y

    @jit(inline=True, flags=STRICT)
    def exact(square: Any) -> Any:
        length = np.sqrt(choose(square > least, square, least))
        return length, one / length

    return exact if strict or real is np.float64 else quick  # type: ignore[no-any-return]


@jit(inline=True)
def _same_row(begin: Any, end: Any, key: Any, along: Any, x: Any, wide: Any, lanes: Any) -> Any:
    """End of the targets from `begin` on that share a row of cells and are not far apart."""
    bound = (key[begin] // along + np.uint64(1)) * along
    low = high = x[begin]
    stop = begin + 1
    while stop < end and stop - begin < lanes and key[stop] < bound:
        low, high = min(low, x[stop]), max(high, x[stop])
        if high - low > wide:
            break
        stop += 1
    return stop


@jit(inline=True)
def _bounds(x: Any, y: Any, z: Any, begin: Any, end: Any) -> Any:
    """Lowest and highest coordinates of some targets."""
    low_x, low_y, low_z = x[begin], y[begin], z[begin]
    high_x, high_y, high_z = low_x, low_y, low_z
    for i in range(begin + 1, end):
        low_x, high_x = min(low_x, x[i]), max(high_x, x[i])
        low_y, high_y = min(low_y, y[i]), max(high_y, y[i])
        low_z, high_z = min(low_z, z[i]), max(high_z, z[i])
    return (low_x, low_y, low_z), (high_x, high_y, high_z)
