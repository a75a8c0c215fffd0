"""The straight pass: one step of every particle as a SIMD loop, and the retirement loop.

With solids, a row whose path might meet one is held: it is left as it was and listed, from
`held[lo]` on; the kernel returns how many. The exceptions pass takes them through their impacts.
"""

from __future__ import annotations

from motes.compile.advance import stage_times
from motes.compile.motion import Motion, write_potential
from motes.compile.surfaces import Surfaces
from motes.compile.text import AXES, STATE, Text
from motes.compile.threat import END


def write_straight(text: Text, motion: Motion, surfaces: Surfaces | None) -> None:
    """Write the kernels `straight` and, where they apply, `young` and `retire`.

    `young` takes newborns from their births to the step's end; it needs values that do not vary in
    time, since every row has stage times of its own.
    """
    loop = _Loop(text, motion)
    _write_step(text, motion, surfaces, loop, young=False)
    if not text.values.varies_in_time:
        _write_step(text, motion, surfaces, loop, young=True)
    if motion.mortal:
        _write_retire(text, loop)


HEAD = "(position, velocity, birth, columns, past, flags, held, K, t, end, lo, hi):\n"

CHUNK = 2048
"""Rows whose ages are found at once: a double in the main loop would halve its SIMD width."""

LEAST = 1e-30
"""Clearance [m] below which a row is held back, so that a clearance of zero has the sign."""

DEAD, HELD = 1, 2
"""What a row's flag says."""

LISTING = f"""        if some != 0:
            for i in range(flag.size):
                if flag[i] & {HELD}:
                    held[lo + count] = low + i
                    count += 1
    return count
"""
"""Most blocks of rows are clear, and are not looked through."""


class _Loop:
    """What every loop over rows says."""

    def __init__(self, text: Text, motion: Motion) -> None:
        self.past = [f"p{k}" for k in range(motion.remembers)]
        self.names = [f"c{i}" for i in range(sum(c.width for c in text.values.columns))]
        self.state = STATE if motion.inertial else AXES
        self.row = ", ".join(f"{n}[i]" if n in self.state else "F(0.0)" for n in STATE)
        self.columns = f"({''.join(f'{n}[i], ' for n in self.names) or 'F(0.0),'})"

    def slices(self, low: str, high: str, indent: str, past: bool = False) -> str:
        """Source that cuts the columns to a range of rows."""
        parts = [(n, _block(n)) for n in self.state]
        parts += [(n, f"columns[{i}]") for i, n in enumerate(self.names)]
        parts += [(n, f"past[{i}]") for i, n in enumerate(self.past) if past]
        parts.append(("born", "birth"))
        return "".join(f"{indent}{n} = {array}[{low}:{high}]\n" for n, array in parts)


def _write_step(
    text: Text, motion: Motion, surfaces: Surfaces | None, loop: _Loop, young: bool
) -> None:
    places = stage_times(motion.method)
    stages = range(len(places))
    aged = not young and ("life" in text.values.over or "age" in motion.needs())
    outlived = young or motion.mortal
    prelude = "    streams()\n    constants, offsets, splines, L = K\n    dt = end - t\n"
    if young:
        prelude += "    S, now = scene(K, t), F(end)\n"
        body = "            h, age = old[i], F(0.0)\n"
        body += "".join(
            f"            t{i} = F(born[i]) + F({p!r}) * h\n" for i, p in enumerate(places)
        )
        scene, after = ", ".join("S" for _ in stages), "S"
    else:
        prelude += "    h, now, S = F(dt), F(end), scene(K, end)\n"
        for i, place in enumerate(places):
            prelude += (
                f"    t{i} = F(t + {place!r} * dt)\n    S{i} = scene(K, t + {place!r} * dt)\n"
            )
        body = f"            age = {'ages[i]' if aged else 'F(0.0)'}\n"
        scene, after = ", ".join(f"S{i}" for i in stages), "S"
    times, ends = ", ".join(f"t{i}" for i in stages), ", ".join(END)
    before = "".join(f"{n}[i], " for n in loop.past) if not young else ""
    call = f"{loop.row}, {before}age, C, {scene}, L, {times}, h"
    step = "proceed" if before else "advance"
    body += f"            C = {loop.columns}\n            {ends} = {step}({call})\n"
    if before:  # A row that is held forgets its past in the exceptions pass.
        for k, n in enumerate(STATE):
            body += f"            p{k}[i] = {f'n{n} - {n}[i]' if n in loop.state else 'F(0.0)'}\n"
        body += "            p6[i] = F(1.0) / h\n"
    marks = []
    if surfaces is not None:
        prelude += "    D0, D1 = solids(scene(K, t)), solids(scene(K, end))\n"
        body += (
            f"            clear = clearance(D0, D1, {loop.row}, {ends}, h) - F({LEAST})\n"
            "            stays = clear.view(bits) >> SIGN\n            some = bits(some | stays)\n"
        )
        marks.append(f"uint8(stays & {HELD})")
        for n in loop.state:
            body += (
                f"            was = {n}[i].view(bits)\n"
                f"            {n}[i] = bits(was ^ ((was ^ n{n}.view(bits)) & ~stays)).view(F)\n"
            )
    else:
        body += "".join(f"            {n}[i] = n{n}\n" for n in loop.state)
    if motion.mortal:
        body += f"            gone = dies({ends}, old[i], C, {after}, L, now)\n"
        marks.append(f"uint8({DEAD}) * uint8(gone)")
    if marks:
        body += f"            flag[i] = uint8({' | '.join(marks)})\n"
    since = [("ages", "t")] * aged + [("old", "end")] * outlived
    found = "".join(f"        {name} = room_of_{name}[: high - low]\n" for name, _ in since)
    if since:
        found += "        for i in range(born.size):\n"
    for name, time in since:
        prelude += f"    room_of_{name} = empty({CHUNK}, F)\n"
        found += f"            {name}[i] = F({time} - born[i])\n"
    listing = ""
    if surfaces is not None:
        prelude += "    count = 0\n"
        found += "        some = bits(0)\n"
        listing = LISTING
    text.add(
        f"@kernel\ndef {'young' if young else 'straight'}{HEAD}{prelude}"
        f"    for low in range(lo, hi, {CHUNK}):\n"
        f"        high = min(low + {CHUNK}, hi)\n"
        f"{loop.slices('low', 'high', ' ' * 8, past=not young)}        flag = flags[low:high]\n"
        f"{found}        for i in range(x.size):\n{body}{listing}"
    )


def _write_retire(text: Text, loop: _Loop) -> None:
    """Write `retire`, which flags the dead among given rows: those that took no straight path."""
    text.add(
        "@kernel\ndef retire(position, velocity, birth, columns, flags, K, t, rows):\n"
        f"{loop.slices('', '', ' ' * 4)}"
        "    constants, offsets, splines, L = K\n"
        "    S, now = scene(K, t), F(t)\n    for r in range(rows.size):\n"
        f"        i = rows[r]\n        age, C = F(t - born[i]), {loop.columns}\n"
        f"        gone = dies({loop.row}, age, C, S, L, now)\n"
        f"        flags[i] = uint8({DEAD}) if gone else uint8(0)\n"
    )


def _block(name: str) -> str:
    axis = "xyz".index(name[-1])
    return f"velocity[{axis}]" if name.startswith("v") else f"position[{axis}]"


def write_potentials(text: Text, motion: Motion) -> None:
    """Write the kernel `potentials`: the forces' potential [m2/s2] at every row."""
    write_potential(text, motion)
    loop = _Loop(text, motion)
    text.add(
        "@kernel\ndef potentials(position, velocity, birth, columns, K, t, out, lo, hi):\n"
        f"{loop.slices('lo', 'hi', ' ' * 4)}    constants, offsets, splines, L = K\n"
        "    phi, S, now = out[lo:hi], scene(K, t), F(t)\n"
        "    for i in range(x.size):\n"
        f"        age, C = F(t - born[i]), {loop.columns}\n"
        f"        phi[i] = potential({loop.row}, age, C, S, L, now)\n"
    )
