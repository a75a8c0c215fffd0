"""The staged form of a system's motion: one stage of a method for all rows, before the next stage.

Systems that feel each other cannot go through a step particle by particle. Their kernels evaluate
the right-hand side of every row at one stage, with what the interactions add (`push`) as arrays.
"""

from __future__ import annotations

from typing import Any

from motes.compile.advance import stage_times
from motes.compile.motion import Motion
from motes.compile.straight import HELD
from motes.compile.surfaces import Surfaces
from motes.compile.text import AXES, STATE, Text
from motes.jit import jit
from motes.tableau import BackwardDifference, Explicit, Implicit, Nystrom, Rosenbrock, Splitting


def write_staged(text: Text, motion: Motion) -> None:
    """Write `slope` (Runge-Kutta methods), `settled` or `led` (implicit ones), `kick` and `drift`.

    `settled` solves a stage of each row with its push given: Y becomes base + dt f(Y). Where stages
    belong together it finds the slopes of all of them, from base, with a push for each. `eased` is
    what a split method takes explicitly.
    """
    columns = sum(c.width for c in text.values.columns)
    names = [f"c{i}" for i in range(columns)]
    carried = "(" + "".join(f"{n}[i], " for n in names) + ("" if names else "F(0.0),") + ")"
    slices = "".join(f"    {n} = Y[{k}][lo:hi]\n" for k, n in enumerate(STATE))
    slices += "".join(f"    {n} = columns[{i}][lo:hi]\n" for i, n in enumerate(names))
    slices += "".join(f"    g{a} = push[{k}][lo:hi]\n" for k, a in enumerate(AXES))
    slices += "    born = birth[lo:hi]\n    constants, offsets, splines, L = K\n"
    slices += "    S, now = scene(K, t), F(t)\n"
    row = ", ".join(f"{n}[i]" for n in STATE)
    begin = f"    for i in range(x.size):\n        age, C = F(t - born[i]), {carried}\n"
    call = f"({row}, age, C, S, L, now)"
    pushed = f"        ax, ay, az, r, bx, by, bz = pushed{call}\n"
    pushed += "".join(f"        a{a} += g{a}[i]\n" for a in AXES)
    if motion.limits:
        pushed += f"        ax, ay, az = limited{call[:-1]}, ax, ay, az)\n"
    flows = f"        ux, uy, uz = carried{call}\n" if motion.flows else ""
    if isinstance(motion.method, Splitting):
        change = "        g = damped_time(r, h)\n" if motion.relaxes else "        g = h\n"
        change += "".join(f"        v{a}[i] += g * (a{a} + b{a} - r * v{a}[i])\n" for a in AXES)
        head = "(Y, birth, columns, push, K, t, dt, lo, hi):\n    h = F(dt)\n"
        text.add(f"@kernel\ndef kick{head}{slices}{begin}{pushed}{change}")
        text.add(f"@kernel\ndef drift{head}{slices}{begin}{_drift(motion, flows, row)}")
        return
    outputs = "".join(f"    k{n} = slope_[{k}][lo:hi]\n" for k, n in enumerate(STATE))
    moved = "".join(f"        k{a}[i] = v{a}[i]{f' + u{a}' if flows else ''}\n" for a in AXES)
    change = "".join(f"        kv{a}[i] = a{a} + b{a} - r * v{a}[i]\n" for a in AXES)
    head = "(Y, birth, columns, push, slope_, K, t, lo, hi):\n" + slices + outputs + begin
    text.add(f"@kernel\ndef slope{head}{flows}{moved}{pushed}{change}")
    if motion.split:
        still = "".join(f"        k{a}[i] = F(0.0)\n" for a in AXES)
        mild = pushed.replace("pushed(", "mild(")
        text.add(f"@kernel\ndef eased{head}{still}{mild}{change}")
    if not isinstance(motion.method, Explicit | Nystrom):
        text.add(_settled(motion, slices, begin, row))


def _settled(motion: Motion, slices: str, begin: str, row: str) -> str:
    """Source of `settled`."""
    method = motion.method
    head = "(Y, birth, columns, push, base, K, t, dt, lo, hi):\n"
    slices += "".join(f"    p{n} = base[{k}][lo:hi]\n" for k, n in enumerate(STATE))
    known, push = [f"p{n}[i]" for n in STATE], "gx[i], gy[i], gz[i]"
    lines = "    g = F(dt)\n"
    if isinstance(method, Implicit) and not method.diagonal:
        head = head.replace("base, ", "base, slope_, ")
        m, body = len(stage_times(method)), ""
        lines = f"    h, k, G = F(dt), empty({6 * m}, F), empty({3 * m}, F)\n"
        for j, place in enumerate(stage_times(method)):
            lines += f"    S{j}, t{j} = scene(K, t + {place!r} * dt), F(t + {place!r} * dt)\n"
        body = f"        for j in range({3 * m}):\n            G[j] = push[j, lo + i]\n"
        scene, times = (", ".join(f"{c}{j}" for j in range(m)) for c in "St")
        body += f"        together({', '.join(known)}, G, k, h, age, C, {scene}, L, {times})\n"
        body += f"        for j in range({6 * m}):\n            slope_[j, lo + i] = k[j]\n"
    elif isinstance(method, BackwardDifference):
        head = head.replace("base, ", "base, past, ")
        slices += "".join(f"    q{k} = past[{k}][lo:hi]\n" for k in range(motion.remembers))
        body = "        c, w = weights_of_past(g, q6[i])\n"
        start = ", ".join(f"{n} + c * q{k}[i]" for k, n in enumerate(known))
        body += f"        {row} = settle({start}, {push}, w, age, C, S, L, now)\n"
    elif isinstance(method, Rosenbrock):
        return _led(slices, begin, row)
    else:
        body = f"        {row} = settle({', '.join(known)}, {push}, g, age, C, S, L, now)\n"
    return f"@kernel\ndef settled{head}{slices}{lines}{begin}{body}"


def _led(slices: str, begin: str, row: str) -> str:
    """Source of `led`: the u of (1 / (gamma h) - J) u = base, with J of a row's own forces at Y."""
    body = f"        shifted({row}, M, pivots, h, age, C, S, L, now)\n"
    body += "".join(f"        r[{k}] = p{n}[i]\n" for k, n in enumerate(STATE))
    body += "".join(f"        r[{k}] += g{a}[i]\n" for k, a in enumerate(AXES, 3))
    body += "        substitute(M, pivots, r)\n"
    body += "        for j in range(6):\n            way[j, lo + i] = r[j]\n"
    room = "    h, M, pivots, r = F(dt), empty(36, F), empty(6, F), empty(6, F)\n"
    head = "@kernel\ndef led(Y, birth, columns, push, base, way, K, t, dt, lo, hi):\n"
    return head + slices + room + begin + body


def write_threats(text: Text, surfaces: Surfaces) -> None:
    """Write `threats`, which lists rows that may meet a solid on the way from a state to Y.

    They stand in `held` from `lo` on; the kernel returns how many.
    """
    slices = "".join(
        f"    {n}, n{n} = {'velocity' if n.startswith('v') else 'position'}[{k % 3}][lo:hi], "
        f"Y[{k}][lo:hi]\n"
        for k, n in enumerate(STATE)
    )
    row, ends = (", ".join(f"{m}{n}[i]" for n in STATE) for m in ("", "n"))
    moved = "D0, solids(scene(K, end))" if surfaces.moving else "D0, D0"
    text.add(
        "@kernel\ndef threats(position, velocity, flags, held, K, Y, t, end, lo, hi):\n"
        f"{slices}    D0 = solids(scene(K, t))\n    D0, D1 = {moved}\n"
        "    flag, h, count = flags[lo:hi], F(end - t), 0\n    for i in range(x.size):\n"
        f"        flag[i] = uint8({HELD}) * uint8(threatened(D0, D1, {row}, {ends}, h))\n"
        f"    for i in range(flag.size):\n        if flag[i]:\n"
        "            held[lo + count] = lo + i\n            count += 1\n    return count\n"
    )


def _drift(motion: Motion, flows: str, row: str) -> str:
    """Source that moves a row with its velocity and, by the midpoint rule, with the flows."""
    if not motion.flows:
        return "".join(f"        {a}[i] += h * v{a}[i]\n" for a in AXES)
    middle = "".join(f"        m{a} = {a}[i] + F(0.5) * h * (v{a}[i] + u{a})\n" for a in AXES)
    velocity = row.split(", ", 3)[3]
    later = "age + F(0.5) * h, C, scene(K, t + 0.5 * dt), L, F(t + 0.5 * dt)"
    again = f"        ux, uy, uz = carried(mx, my, mz, {velocity}, {later})\n"
    moved = "".join(f"        {a}[i] += h * (v{a}[i] + u{a})\n" for a in AXES)
    return flows + middle + again + moved


@jit
def combine(base: Any, slopes: Any, weights: Any, h: Any, out: Any, lo: Any, hi: Any) -> None:
    """out = base + h sum_j weights_j slopes_j, for rows lo to hi of blocks (6, n)."""
    for k in range(6):
        target, source = out[k][lo:hi], base[k][lo:hi]
        for i in range(target.size):
            target[i] = source[i]
        for j in range(weights.size):
            share = h * weights[j]
            if share != 0.0:
                slope = slopes[j, k][lo:hi]
                for i in range(target.size):
                    target[i] += share * slope[i]
