"""The threat test: whether a particle's path through a step might meet a solid.

It errs on the safe side, and is cheap enough for every row of the straight pass. The path is the
cubic through both ends with their velocities; its control polygon has the legs a = h v0 / 3,
c = h v1 / 3 and b, what remains. Two bounds serve:

- A plane's distance is linear, and the cubic lies in the convex hull of its four control points:
  it meets no plane when all four lie above it.
- No distance falls faster than one metre a metre: a path of length l whose ends are d0 and d1 away
  meets no solid when d0 + d1 > l; and l^2 <= 3 (|a|^2 + |b|^2 + |c|^2).
"""

from __future__ import annotations

from functools import reduce

from motes.compile.motion import Motion
from motes.compile.surfaces import Surfaces
from motes.compile.text import AXES, STATE, Text

END = tuple(f"n{name}" for name in STATE)
"""Names of position and velocity at the end of the step."""


def write_threat(text: Text, motion: Motion, surfaces: Surfaces) -> None:
    """Write `clearance(D0, D1, x, ..., vz, nx, ..., nvz, h)` and `threatened`, of the same.

    The clearance is above zero for a path that meets no solid.
    """
    lines = "    third = h * F(0.3333333333333333)\n"
    for a in AXES:
        if motion.inertial and not motion.flows:
            lines += f"    a{a}, c{a} = third * v{a}, third * nv{a}\n"
        else:  # The velocity along the path is not at hand: a straight line.
            lines += f"    a{a} = F(0.3333333333333333) * (n{a} - {a})\n    c{a} = a{a}\n"
    tests = []
    steep = []
    for k, (_, solid) in enumerate(surfaces.solids):
        if getattr(type(solid), "flat", False) and not surfaces.moving:
            tests.append(_lowest(k))
        else:
            steep.append(k)
    if steep:
        lines += "    l2 = F(0.0)\n"
        for a in AXES:
            lines += f"    b{a} = n{a} - {a} - a{a} - c{a}\n"
            lines += f"    l2 += a{a} * a{a} + b{a} * b{a} + c{a} * c{a}\n"
    for k in steep:
        lines += f"    d = solid_{k}(D0, x, y, z) + solid_{k}(D1, nx, ny, nz)\n"
        if surfaces.moving:  # In the solid's frame the path is longer by what the solid moves.
            lines += f"    d -= carried_by(D0, D1, {surfaces.starts[k]}, x, y, z)\n"
        lines += f"    far_{k} = min(d, d * d - F(3.0) * l2)\n"
        tests.append(f"far_{k}")
    names = f"D0, D1, {', '.join((*STATE, *END))}, h"
    text.add(f"@inline\ndef clearance({names}):\n{lines}    return {reduce(_smaller, tests)}\n")
    text.add(f"@inline\ndef threatened({names}):\n    return clearance({names}) <= F(0.0)\n")


def _smaller(a: str, b: str) -> str:
    return f"min({a}, {b})"


def _lowest(k: int) -> str:
    """The smallest distance of a flat solid from the four control points."""
    points = (
        ("x", "y", "z"),
        tuple(f"{a} + a{a}" for a in AXES),
        tuple(f"n{a} - c{a}" for a in AXES),
        ("nx", "ny", "nz"),
    )
    a, b, c, d = (f"solid_{k}(D0, {', '.join(point)})" for point in points)
    return _smaller(_smaller(a, b), _smaller(c, d))
