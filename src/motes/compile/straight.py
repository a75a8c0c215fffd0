"""The straight pass: one step of every particle as a SIMD loop, and the retirement loop.

With solids, a row whose path might meet one is left as it was and flagged; the exceptions pass
takes it through its impacts.
"""

from __future__ import annotations

from motes.compile.motion import Motion, stage_times
from motes.compile.surfaces import Surfaces
from motes.compile.text import AXES, STATE, Text
from motes.compile.threat import END


def write_straight(text: Text, motion: Motion, surfaces: Surfaces | None) -> None:
    """Write the kernels `straight` and, where anything retires, `retire`."""
    columns = sum(c.width for c in text.values.columns)
    names = [f"c{i}" for i in range(columns)]
    state = STATE if motion.inertial else AXES
    slices = "".join(f"    {n} = {_block(n)}[lo:hi]\n" for n in state)
    slices += "".join(f"    {n} = columns[{i}][lo:hi]\n" for i, n in enumerate(names))
    slices += "    born = birth[lo:hi]\n    constants, offsets, splines, L = K\n"
    row = ", ".join(f"{n}[i]" if n in state else "F(0.0)" for n in STATE)
    carried = "(" + "".join(f"{n}[i], " for n in names) + ("" if names else "F(0.0),") + ")"
    places = stage_times(motion.method)
    prelude = "    h = F(dt)\n"
    for i, place in enumerate(places):
        prelude += f"    t{i} = F(t + {place!r} * dt)\n"
        prelude += f"    S{i} = scene(K, t + {place!r} * dt)\n"
    if surfaces is not None:
        prelude += "    D0, D1 = solids(scene(K, t)), solids(scene(K, t + dt))\n"
    stages = range(len(places))
    scene = ", ".join(f"S{i}" for i in stages)
    times = ", ".join(f"t{i}" for i in stages)
    ends = ", ".join(END)
    loop = "    for i in range(x.size):\n"
    loop += f"        age, C = F(t - born[i]), {carried}\n"
    loop += f"        {ends} = advance({row}, age, C, {scene}, L, {times}, h)\n"
    if surfaces is not None:
        loop += f"        meets = threatened(D0, D1, {row}, {ends}, h)\n"
        loop += "".join(f"        {n}[i] = {n}[i] if meets else n{n}\n" for n in state)
        loop += "        flag[i] = meets\n"
    else:
        loop += "".join(f"        {n}[i] = n{n}\n" for n in state)
    head = "(position, velocity, birth, columns, flags, K, t, dt, lo, hi):\n"
    flags = "    flag = flags[lo:hi]\n" if surfaces is not None else ""
    text.add(f"@kernel\ndef straight{head}{slices}{flags}{prelude}{loop}")
    if motion.mortal:
        text.add(
            f"@kernel\ndef retire{head}{slices}    flag = flags[lo:hi]\n"
            "    S, now = scene(K, t), F(t)\n    for i in range(x.size):\n"
            f"        age, C = F(t - born[i]), {carried}\n"
            f"        flag[i] = dies({row}, age, C, S, L, now)\n"
        )


def _block(name: str) -> str:
    axis = "xyz".index(name[-1])
    return f"velocity[{axis}]" if name.startswith("v") else f"position[{axis}]"
