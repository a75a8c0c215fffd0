"""The solids of a scene as functions of a point: `solids` (poses at a time), `near` (distance).

`solids(S)` gives one flat tuple D. Solid k begins at START[k]: position (3), rotation matrix by
rows (9), restitution, friction, then its own parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from motes.catalog import Component
from motes.compile.text import Text, packed
from motes.control.constant import Constant

POSE = 12
HEAD = POSE + 2
"""Numbers before a solid's own parameters."""

MATRIX = {
    "a": "cy * cz", "b": "sx * sy * cz - cx * sz", "c": "cx * sy * cz + sx * sz",
    "d": "cy * sz", "e": "sx * sy * sz + cx * cz", "f": "cx * sy * sz - sx * cz",
    "g": "-sy", "h": "sx * cy", "i": "cx * cy",
}  # fmt: skip
"""The rotation matrix by rows, from cosines and sines of the three angles."""

UNTURNED = [f"F({value})" for value in (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)]

CARRIED = """@inline
def moved(D0, D1, k, x, y, z):
    x -= D0[k]
    y -= D0[k + 1]
    z -= D0[k + 2]
    a = D0[k + 3] * x + D0[k + 6] * y + D0[k + 9] * z
    b = D0[k + 4] * x + D0[k + 7] * y + D0[k + 10] * z
    c = D0[k + 5] * x + D0[k + 8] * y + D0[k + 11] * z
    return (
        D1[k] + D1[k + 3] * a + D1[k + 4] * b + D1[k + 5] * c,
        D1[k + 1] + D1[k + 6] * a + D1[k + 7] * b + D1[k + 8] * c,
        D1[k + 2] + D1[k + 9] * a + D1[k + 10] * b + D1[k + 11] * c,
    )


@inline
def carried_by(D0, D1, k, x, y, z):
    a, b, c = moved(D0, D1, k, x, y, z)
    return sqrt((a - x) * (a - x) + (b - y) * (b - y) + (c - z) * (c - z))
"""
"""Where a point fixed to the solid that begins at entry k gets between two poses, and how far."""


@dataclass(frozen=True)
class Surfaces:
    """Solids with their addresses, and where each begins in D."""

    solids: tuple[tuple[str, Component], ...]
    starts: tuple[int, ...]
    length: int
    """Numbers in D."""

    @property
    def moving(self) -> bool:
        """Whether any solid moves or changes over time."""
        return any(
            not isinstance(control, Constant)
            for _, solid in self.solids
            for key, control in solid.values.items()
            if control.scope != "fixed" and key != "color"
        )


def kernel_of_solids(
    solids: Sequence[tuple[str, Component]], name: str, source: str
) -> tuple[Any, Any]:
    """A kernel in double precision whose text calls `solids` and `solid_0` ..., and the numbers K
    that it is called with."""
    text = Text("double")
    write_surfaces(text, solids)
    text.add(source)
    text.add(text.values.scene_text())
    return text.module()[name], text.values.arrays(np.float64)


def write_surfaces(
    text: Text, solids: Sequence[tuple[str, Component]], prefix: str = ""
) -> Surfaces:
    """Write `solids(S)`, `near(D, x, y, z)` and each `solid_k` into the text.

    Another set of solids in one text needs a prefix for these names.
    """
    lines = ""
    entries: list[str] = []
    starts: list[int] = []
    distances: list[str] = []
    for k, (address, solid) in enumerate(solids):
        pose = {
            key: text.values.add(solid.values[key], f"{address}.{key}")
            for key in ("position", "rotation", "restitution", "friction")
        }
        starts.append(len(entries))
        turned = not _is_default(solid, "rotation")
        if turned:
            lines += _rotation(k, pose["rotation"])
        matrix = [f"{name}{k}" for name in MATRIX] if turned else UNTURNED
        entries += [*pose["position"], *matrix, *pose["restitution"], *pose["friction"]]
        distance = _distance(text, solid, address, k, starts[-1], entries, turned)
        distances.append(f"@inline\ndef {prefix}{distance}")
    text.add(f"@inline\ndef {prefix}solids(S):\n{lines}    return ({', '.join(entries)},)\n")
    body = f"    best, which = {prefix}solid_0(D, x, y, z), 0\n"
    for k in range(1, len(solids)):
        body += f"    d = {prefix}solid_{k}(D, x, y, z)\n"
        body += f"    which = {k} if d < best else which\n    best = min(best, d)\n"
    for source in distances:
        text.add(source)
    text.add(f"@inline\ndef {prefix}near(D, x, y, z):\n{body}    return best, which\n")
    if not prefix:
        text.add(CARRIED)
    return Surfaces(tuple(solids), tuple(starts), len(entries))


def _is_default(solid: Component, key: str) -> bool:
    return solid.values[key] == solid.parameters[key].control(solid.parameters[key].default)


def _rotation(k: int, angles: Sequence[str]) -> str:
    """Source of the rotation matrix of solid k from its angles [degrees]."""
    lines = ""
    for axis, angle in zip("xyz", angles, strict=True):
        lines += f"    {axis} = {angle} * F(0.017453292519943295)\n"
        lines += f"    c{axis}, s{axis} = cos({axis}), sin({axis})\n"
    return lines + "".join(f"    {name}{k} = {value}\n" for name, value in MATRIX.items())


def _distance(
    text: Text,
    solid: Component,
    address: str,
    k: int,
    start: int,
    entries: list[str],
    turned: bool,
) -> str:
    """Source of one solid's distance from a point of the scene; adds its parameters to D."""
    placed = not _is_default(solid, "position")
    rows = "".join(f"    {a} -= D[{start + i}]\n" for i, a in enumerate("xyz")) if placed else ""
    local = ["x", "y", "z"]
    if turned:
        local = [
            " + ".join(f"D[{start + 3 + 3 * row + column}] * {a}" for row, a in enumerate("xyz"))
            for column in range(3)
        ]

    def entry(key: str) -> str:
        expressions = text.values.add(solid.values[key], f"{address}.{key}")
        first = len(entries)
        entries.extend(expressions)
        return packed([f"D[{first + i}]" for i in range(len(expressions))])

    call = text.call(solid, address, "distance", ", ".join(local), entry)
    return f"solid_{k}(D, x, y, z):\n{rows}    return {call.source}\n"
