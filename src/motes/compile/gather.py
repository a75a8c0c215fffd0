"""Gathering laws in one loop: the sums of several laws over neighbours that cells give at once.

Lists of neighbours pay while particles move little in a step. What flies a good part of its reach
in a step needs others each time; then it is quicker to let a cell's particles meet all that are in
and around the cell, in vector instructions, with all laws in one loop.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motes.compile.pairs import Law, Writer
from motes.compile.text import AXES, Text
from motes.interact.cells import runs_around
from motes.jit import STRICT, jit

WIDTH = 8
"""Candidates are filled up to a multiple of this: loops over them have no rest."""

FAR = 1e15
"""A coordinate [m] further away than anything, whose square single precision still holds."""


def read(laws: Sequence[Law], which: int) -> tuple[str, ...]:
    """Fields that laws read of a target (0) or a source (1), place first."""
    names = {name for law in laws for name in law.fields[which]}
    return (*AXES, *sorted(names - set(AXES)))


def gather_kernel(laws: Sequence[Law]) -> Any:
    """The kernel that writes all laws' sums, one after another, for targets from `begin` on.

    It returns the first target that there is no room for, and the candidates that it has.
    """
    text = Text(laws[0].precision, laws[0].strict)
    own, other = read(laws, 0), read(laws, 1)
    body, start, end, place = "", "", "", 0
    prelude = ""
    for i, law in enumerate(laws):
        writer = Writer(text, law)
        width = law.sums()
        names = [f"n{place + k}" for k in range(width)]
        numbers = writer.p().replace("numbers[", f"numbers[{i}][")
        prelude += f"    p{i}, limit{i}, reach{i} = {numbers}, limits[{i}], sqrt(limits[{i}])\n"
        call = writer.call("near").replace("(p, ", f"(p{i}, ", 1)
        call = call.replace("rx, ry, rz, square, sqrt(square)", "ux, uy, uz, u2, far")
        # Whoever does not count is put at the reach and weighs nothing: a conditional sum would
        # keep the loop from becoming vector instructions.
        body += f"                near = square <= limit{i}\n"
        body += (
            f"                weight, u2 = F(1.0 if near else 0.0), square if near else limit{i}\n"
        )
        body += (
            f"                ux, far = rx if near else reach{i}, length if near else reach{i}\n"
        )
        body += "                uy, uz = ry if near else F(0.0), rz if near else F(0.0)\n"
        body += f"                {', '.join(names)}, = {call}\n"
        for k in range(place, place + width):
            start += f"            sum{k} = F(0.0)\n"
            body += f"                sum{k} += weight * n{k}\n"
            end += f"            out[{k}, t] = sum{k}\n"
        place += width
    limits = ", ".join(f"limit{i}" for i in range(len(laws)))
    widest = f"max({limits})" if len(laws) > 1 else limits
    lines = (
        "@kernel\ndef gather(numbers, limits, grid, targets, key, sources, cells, itself, "
        "begin, end, room_, out):\n"
        "    runs, slots, room, near_, pick, kept = room_\n"
        "    number, points, size, i = 0, 0, 0, begin\n"
        f"{prelude}    most = {widest}\n"
    )
    lines += "".join(f"    t_{n} = targets[{k}]\n" for k, n in enumerate(own))
    for k, n in enumerate(other):
        lines += f"    s_{n}, k_{n} = sources[{k}], kept[{k}]\n"
    lines += "".join(f"    c_{n} = room[{k}]\n" for k, n in enumerate(AXES))
    lines += (
        "    while i < end:\n"
        "        now, stop = key[i], i + 1\n"
        "        while stop < end and key[stop] == now:\n            stop += 1\n"
        "        number, points, crosses = runs_around(now, grid, cells, runs)\n"
        f"        if points + {WIDTH} > slots.size:\n            return i, points\n"
        "        fill(number, runs, sources, room, slots)\n"
        "        if crosses:\n"
        "            bring((t_x[i], t_y[i], t_z[i]), grid.box, points, room)\n"
        "        for t in range(i, stop):\n"
        "            me = uint32(t) if itself else nobody\n"
    )
    lines += "".join(f"            a_{n} = t_{n}[t]\n" for n in own)
    lines += start + "            place = (a_x, a_y, a_z)\n"
    lines += "            held = choose(place, room, slots[:points], me, most, near_, pick)\n"
    lines += "            for e in range(held):\n"
    lines += "                q = pick[e]\n                k = slots[q]\n"
    for n in other:
        lines += f"                k_{n}[e] = {f'c_{n}[q]' if n in AXES else f's_{n}[k]'}\n"
    lines += f"            size = -(-held // {WIDTH}) * {WIDTH}\n"
    lines += "            for e in range(held, size):\n"
    for n in other:
        lines += f"                k_{n}[e] = F({FAR if n in AXES else 0.0!r})\n"
    lines += "".join(f"            q_{n} = k_{n}[:size]\n" for n in other)
    lines += "            for q in range(q_x.size):\n"
    lines += "".join(f"                b_{n} = q_{n}[q]\n" for n in other)
    lines += (
        "                rx, ry, rz = a_x - b_x, a_y - b_y, a_z - b_z\n"
        "                square = rx * rx + ry * ry + rz * rz\n"
        "                length = sqrt(square)\n"
    )
    lines += body + end + "        i = stop\n    return end, 0\n"
    text.add(lines)
    extra = {"uint32": np.uint32, "nobody": np.uint32(0xFFFFFFFF), "runs_around": runs_around}
    extra |= {"fill": fill, "bring": bring, "choose": choose}
    return text.module(extra)["gather"]


@jit(flags=STRICT)
def fill(number: Any, runs: Any, sources: Any, room: Any, slot: Any) -> None:
    """Copy the places of the sources in some runs to consecutive memory."""
    end = 0
    for k in range(number):
        low, high = runs[k, 0], runs[k, 1]
        begin, end = end, end + high - low
        for axis in range(3):
            old, new = sources[axis, low:high], room[axis, begin:end]
            for q in range(old.size):
                new[q] = old[q]
        mine = slot[begin:end]
        for q in range(mine.size):
            mine[q] = np.uint32(low + q)


@jit(inline=True)
def choose(place: Any, room: Any, slot: Any, me: Any, limit: Any, near: Any, pick: Any) -> Any:
    """Write which candidates are within reach of a place, and not the one itself; how many."""
    x, y, z = place
    xs, ys, zs = room[0][: slot.size], room[1][: slot.size], room[2][: slot.size]
    marks = near[: slot.size]
    for q in range(slot.size):
        dx, dy, dz = x - xs[q], y - ys[q], z - zs[q]
        marks[q] = (dx * dx + dy * dy + dz * dz <= limit) & (slot[q] != me)
    new = np.uint64(0)
    for q in range(slot.size):
        pick[new] = np.uint32(q)
        new += np.uint64(marks[q])
    return np.int64(new)


@jit(flags=STRICT)
def bring(center: Any, box: Any, size: Any, room: Any) -> None:
    """Replace sources by their images nearest to a place, along periodic axes."""
    for axis in range(3):
        period = box[axis]
        if np.isfinite(period):
            for q in range(size):
                away = room[axis, q] - center[axis]
                if away > period / 2:
                    room[axis, q] -= period
                elif away < -period / 2:
                    room[axis, q] += period
