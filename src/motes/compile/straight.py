"""The straight pass: one step of every particle as a SIMD loop, and the retirement loop.

With solids, a row whose path might meet one is left as it was and flagged; the exceptions pass
takes it through its impacts. The test errs on the safe side: a distance function cannot fall faster
than one meter a meter, so a path of length l whose ends are d0 and d1 away meets no solid when
d0 + d1 > l. For the cubic through both ends, l^2 <= 3 (|a|^2 + |b|^2 + |c|^2), where a, b, c are the
legs of its control polygon.
"""

from __future__ import annotations

from motes.compile.motion import Motion, stage_times
from motes.compile.surfaces import Surfaces
from motes.compile.text import AXES, STATE, Text


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
    ends = ", ".join(f"n{n}" for n in STATE)
    loop = "    for i in range(x.size):\n"
    loop += f"        age, C = F(t - born[i]), {carried}\n"
    loop += f"        {ends} = advance({row}, age, C, {scene}, L, {times}, h)\n"
    if surfaces is not None:
        loop += _threat(motion, surfaces)
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


def _threat(motion: Motion, surfaces: Surfaces) -> str:
    """Source that sets `meets` where the row's path might meet a solid."""
    begin = [f"{n}[i]" for n in AXES]
    if motion.inertial:
        w0, w1 = [f"v{n}[i]" for n in AXES], [f"nv{n}" for n in AXES]
    else:
        w0 = w1 = [f"(n{n} - {n}[i]) / h" for n in AXES]
    lines = f"        d0, _ = near(D0, {', '.join(begin)})\n"
    lines += "        d1, _ = near(D1, nx, ny, nz)\n        third = h * F(0.3333333333333333)\n"
    square = "        l2 = F(0.0)\n"
    for axis, first, v0, v1 in zip(AXES, begin, w0, w1, strict=True):
        lines += f"        a{axis}, c{axis} = third * {v0}, third * {v1}\n"
        lines += f"        b{axis} = n{axis} - {first} - a{axis} - c{axis}\n"
        square += f"        l2 += a{axis} * a{axis} + b{axis} * b{axis} + c{axis} * c{axis}\n"
    gap = "        d = d0 + d1\n"
    if surfaces.moving:  # In the solid's frame the path is longer by what the solid moves.
        for start in surfaces.starts:
            gap += f"        d -= carried_by(D0, D1, {start}, {', '.join(begin)})\n"
    return lines + square + gap + "        meets = (d <= F(0.0)) | (d * d <= F(3.0) * l2)\n"
