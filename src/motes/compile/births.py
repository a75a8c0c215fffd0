"""Births: what is drawn for a newborn, where an emitter puts it, and the loop that does it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motes.catalog import Component
from motes.compile.text import Text, packed
from motes.compile.values import Column, packed_parts
from motes.control.draw import Choice, Normal, Uniform
from motes.jit import EXACT, jit
from motes.kernel import cos, log, sin
from motes.philox import channel, draw, hash_id, uniform_double

FIRST_TICK = np.uint32(0)
CUT = 1.0 - np.exp(-8.0)
"""Probability that a pair of normal numbers has a radius below 4."""

_log, _cos, _sin = (f.compiled("double") for f in (log, cos, sin))


@jit(flags=EXACT, inline=True)
def uniforms(seed: Any, id: Any, name: Any) -> Any:
    """Two uniform numbers in [0, 1) for a particle and a channel."""
    a, b, c, d = draw(seed, id, name, FIRST_TICK)
    return uniform_double(a, b), uniform_double(c, d)


@jit(flags=EXACT, inline=True)
def normals(seed: Any, id: Any, name: Any) -> Any:
    """Two normal numbers, their pair cut off at a radius of 4 (Box and Muller)."""
    u, v = uniforms(seed, id, name)
    radius = np.sqrt(-2.0 * _log(1.0 - CUT * u))
    return radius * _cos(2.0 * np.pi * v), radius * _sin(2.0 * np.pi * v)


class Channels:
    """The channels that a piece of generated text draws from, in the order of their use."""

    def __init__(self) -> None:
        self.numbers: list[int] = []

    def add(self, address: str) -> str:
        """Channel of an address, as an expression of the generated text."""
        self.numbers.append(channel(address))
        return f"channels[{len(self.numbers) - 1}]"

    def array(self) -> np.ndarray[Any, Any]:
        """All channels as the kernels read them."""
        return np.array(self.numbers or [0], np.uint32)


def write_draws(text: Text, columns: Sequence[Column], channels: Channels) -> None:
    """Write `drawn(K, S, seed, id, channels, t)`, the tuple of all columns of a newborn."""
    lines, results = "    constants, offsets, splines, L = K\n", []
    for number, column in enumerate(columns):
        source, names = _draw(text, column, number, channels)
        lines += source
        results += names
    text.add(
        "@inline\ndef drawn(K, S, seed, id, channels, t):\n"
        f"{lines}    return ({', '.join(results) or 'F(0.0)'},)\n"
    )


def _draw(text: Text, column: Column, n: int, channels: Channels) -> tuple[str, list[str]]:
    control, width, values = column.control, column.width, text.values
    names = [f"v{n}_{i}" for i in range(width)]
    if control.scope == "scene":
        parts = values.add(control, column.address)
        return "".join(f"    {v} = {e}\n" for v, e in zip(names, parts, strict=True)), names
    wide = width if isinstance(control, Uniform | Normal) else 1
    numbers = "normals" if isinstance(control, Normal) else "uniforms"
    lines = ""
    for i in range(0, wide, 2):
        mark = f"{column.address}#{i // 2}" if i else column.address
        lines += f"    u{i}, u{i + 1} = {numbers}(seed, id, {channels.add(mark)})\n"
    for i, name in enumerate(names):
        if isinstance(control, Uniform):
            low, high = values.constant(control.low[i]), values.constant(control.high[i])
            lines += f"    {name} = {low} + ({high} - {low}) * u{i}\n"
        elif isinstance(control, Normal):
            mean, sigma = values.constant(control.mean[i]), values.constant(control.sigma[i])
            lines += f"    {name} = {mean} + {sigma} * u{i}\n"
        elif isinstance(control, Choice):
            start = len(values.constants)
            for value in control.values[:, i]:
                values.constant(value)
            lines += f"    {name} = F(constants[{start} + int(u0 * {len(control.values)})])\n"
        else:
            values.splines.append(packed_parts(control)[i])  # type: ignore[arg-type]
            k = len(values.splines) - 1
            lines += f"    {name} = F(spline_at(splines[offsets[{k}]:offsets[{k + 1}]], u0))\n"
    return lines, names


def write_emitter(text: Text, emitter: Component, address: str, channels: Channels) -> None:
    """Write `drawn`, `pose(S)` and `newborn(S, C, t, k, seed, id, channels)` of one emitter."""
    values = text.values
    extra = ", ".join(values.add(emitter.values["velocity"], f"{address}.velocity"))
    pose = [
        *values.add(emitter.values["position"], f"{address}.position"),
        *values.add(emitter.values["direction"], f"{address}.direction"),
        *values.add(emitter.values["inherit"], f"{address}.inherit"),
    ]
    text.add(f"@inline\ndef pose(S):\n    return {', '.join(pose)}\n")
    draws = int(getattr(type(emitter), "draws", 4))
    lines = ""
    for i in range(0, draws, 2):
        mark = channels.add(f"{address}#{i // 2}")
        lines += f"    u{i}, u{i + 1} = uniforms(seed, id, {mark})\n"
    numbers = packed([*(f"u{i}" for i in range(draws)), "F(0.0)"])
    call = text.call(emitter, address, "birth", f"{numbers}, t, k")
    text.add(
        "@inline\ndef newborn(S, C, t, k, seed, id, channels):\n"
        f"{lines}    x, y, z, vx, vy, vz = {call.source}\n    ex, ey, ez = {extra}\n"
        "    return x, y, z, vx, vy, vz, ex, ey, ez\n"
    )
    write_draws(text, list(values.columns), channels)


def births_kernel(
    emitter: dict[str, Any], traits: dict[str, Any], width: int, moves: bool, steady: bool
) -> Any:
    """The kernel that writes newborns: row first + j is the `numbers[j]`-th birth, at `times[j]`.

    Rows get what the emitter and the system's traits give at the birth's own instant. `width` is
    the number of trait columns; `moves` says whether particles have a velocity; `steady`, that
    nothing of either varies in time, so that one look at the scene serves all.
    """
    scene, pose, newborn, drawn = (emitter[n] for n in ("scene", "pose", "newborn", "drawn"))
    trait_scene, trait_drawn = traits["scene"], traits["drawn"]
    inherits = not steady  # From an emitter that stands still there is nothing to inherit.

    @jit(flags=EXACT, inline=True)
    def placed(K, t):  # type: ignore[no-untyped-def]
        S = scene(K, t)
        x, y, z, dx, dy, dz, inherit = pose(S)
        return S, (x, y, z), frame(dx, dy, dz), inherit

    @jit(flags=EXACT)
    def births(  # type: ignore[no-untyped-def]
        position, velocity, birth, ids, columns, first, times, numbers, address, seed, K, channels,
        KT, trait_channels,
    ):  # fmt: skip
        S, P, A, inherit = placed(K, 0.0)
        ST = trait_scene(KT, 0.0)
        for j in range(times.size):
            i, t = first + j, times[j]
            id = hash_id(address, numbers[j])
            if not steady:
                S, P, A, inherit = placed(K, t)
                ST = trait_scene(KT, t)
            C = drawn(K, S, seed, id, channels, t)
            x, y, z, vx, vy, vz, ex, ey, ez = newborn(S, C, t, numbers[j], seed, id, channels)
            x, y, z = turned(A, x, y, z)
            position[0, i], position[1, i], position[2, i] = P[0] + x, P[1] + y, P[2] + z
            if moves:
                vx, vy, vz = turned(A, vx, vy, vz)
                if inherits and inherit != 0.0:
                    ax, ay, az, _, _, _, _ = pose(scene(K, t - MOMENT))
                    bx, by, bz, _, _, _, _ = pose(scene(K, t + MOMENT))
                    share = inherit / (2.0 * MOMENT)
                    vx, vy, vz = (
                        vx + share * (bx - ax),
                        vy + share * (by - ay),
                        vz + share * (bz - az),
                    )
                velocity[0, i], velocity[1, i], velocity[2, i] = vx + ex, vy + ey, vz + ez
            birth[i], ids[i] = t, id
            T = trait_drawn(KT, ST, seed, id, trait_channels, t)
            for c in range(width):
                columns[c][i] = T[c]

    return births


MOMENT = 1e-4
"""Half the time [s] over which an emitter's own velocity is measured on its path."""


@jit(flags=EXACT, inline=True)
def frame(dx: Any, dy: Any, dz: Any) -> Any:
    """The axes of an emitter's frame in the scene's: +z is (dx, dy, dz), +y stays level.

    The entries of its matrix by columns; the first axis has no y.
    """
    n = np.sqrt(dx * dx + dy * dy + dz * dz)
    if n == 0.0:
        return 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0
    dx, dy, dz = dx / n, dy / n, dz / n
    level = np.sqrt(dx * dx + dz * dz)
    if level < 1e-9:  # The axis is +-y: x stays.
        return 1.0, 0.0, 0.0, 0.0, -dy, 0.0, dy, 0.0
    ax, az = dz / level, -dx / level
    return ax, az, dy * az, level, -dy * ax, dx, dy, dz


@jit(flags=EXACT, inline=True)
def turned(axes: Any, x: Any, y: Any, z: Any) -> Any:
    """A vector of the emitter's frame in the scene's."""
    ax, az, bx, by, bz, dx, dy, dz = axes
    return ax * x + bx * y + dx * z, by * y + dy * z, az * x + bz * y + dz * z
