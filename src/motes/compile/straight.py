"""The straight pass: one step of every particle as a SIMD loop, and the retirement loop.

With solids, a row whose path might meet one is left as it was and flagged; the exceptions pass
takes it through its impacts.
"""

from __future__ import annotations

from motes.compile.motion import Motion, stage_times, write_potential
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
        text.add(
            f"@kernel\ndef retire{HEAD}{loop.slices}    flag = flags[lo:hi]\n"
            "    S, now = scene(K, t), F(t)\n    for i in range(x.size):\n"
            f"        age, C = F(t - born[i]), {loop.columns}\n"
            f"        flag[i] = dies({loop.row}, age, C, S, L, now)\n"
        )


HEAD = "(position, velocity, birth, columns, flags, K, t, dt, lo, hi):\n"


class _Loop:
    """What every loop over rows says."""

    def __init__(self, text: Text, motion: Motion) -> None:
        names = [f"c{i}" for i in range(sum(c.width for c in text.values.columns))]
        self.state = STATE if motion.inertial else AXES
        self.slices = "".join(f"    {n} = {_block(n)}[lo:hi]\n" for n in self.state)
        self.slices += "".join(f"    {n} = columns[{i}][lo:hi]\n" for i, n in enumerate(names))
        self.slices += "    born = birth[lo:hi]\n    constants, offsets, splines, L = K\n"
        self.row = ", ".join(f"{n}[i]" if n in self.state else "F(0.0)" for n in STATE)
        self.columns = f"({''.join(f'{n}[i], ' for n in names) or 'F(0.0),'})"


def _write_step(
    text: Text, motion: Motion, surfaces: Surfaces | None, loop: _Loop, young: bool
) -> None:
    places = stage_times(motion.method)
    stages = range(len(places))
    slices, prelude, body = loop.slices, "", "    for i in range(x.size):\n"
    if young:
        prelude += "    S = scene(K, t)\n"
        body += "        h, age = F(t + dt - born[i]), F(0.0)\n"
        body += "".join(f"        t{i} = F(born[i]) + F({p!r}) * h\n" for i, p in enumerate(places))
        scene = ", ".join("S" for _ in stages)
    else:
        prelude += "    h = F(dt)\n"
        for i, place in enumerate(places):
            prelude += (
                f"    t{i} = F(t + {place!r} * dt)\n    S{i} = scene(K, t + {place!r} * dt)\n"
            )
        body += "        age = F(t - born[i])\n"
        scene = ", ".join(f"S{i}" for i in stages)
    times, ends = ", ".join(f"t{i}" for i in stages), ", ".join(END)
    body += f"        {ends} = advance({loop.row}, age, {loop.columns}, {scene}, L, {times}, h)\n"
    if surfaces is not None:
        slices += "    flag = flags[lo:hi]\n"
        prelude += "    D0, D1 = solids(scene(K, t)), solids(scene(K, t + dt))\n"
        body += f"        meets = threatened(D0, D1, {loop.row}, {ends}, h)\n"
        body += "".join(f"        {n}[i] = {n}[i] if meets else n{n}\n" for n in loop.state)
        body += "        flag[i] = meets\n"
    else:
        body += "".join(f"        {n}[i] = n{n}\n" for n in loop.state)
    text.add(f"@kernel\ndef {'young' if young else 'straight'}{HEAD}{slices}{prelude}{body}")


def _block(name: str) -> str:
    axis = "xyz".index(name[-1])
    return f"velocity[{axis}]" if name.startswith("v") else f"position[{axis}]"


def write_potentials(text: Text, motion: Motion) -> None:
    """Write the kernel `potentials`: the forces' potential [m2/s2] at every row."""
    write_potential(text, motion)
    loop = _Loop(text, motion)
    text.add(
        "@kernel\ndef potentials(position, velocity, birth, columns, K, t, out, lo, hi):\n"
        f"{loop.slices}    phi, S, now = out[lo:hi], scene(K, t), F(t)\n"
        "    for i in range(x.size):\n"
        f"        age, C = F(t - born[i]), {loop.columns}\n"
        f"        phi[i] = potential({loop.row}, age, C, S, L, now)\n"
    )
