"""The exceptions pass: rows born in the step, and rows whose path might meet a solid.

One row at a time, in double precision. A row flies from its own beginning to the end of the step;
at an impact it is reflected and flies on (`compile/encounter.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.compile.encounter import encounter_kernel
from motes.compile.motion import Motion, stage_times
from motes.compile.surfaces import Surfaces
from motes.compile.text import STATE, Text
from motes.jit import EXACT, jit


def write_flight(text: Text, motion: Motion) -> None:
    """Write `gather`, `fly` (one step of any length at any time), `total` (velocity and flow)."""
    width = sum(c.width for c in text.values.columns)
    entries = "".join(f"F(columns[{i}][i]), " for i in range(width)) or "F(0.0),"
    state = ", ".join(STATE)
    places = stage_times(motion.method)
    scene = ", ".join(f"scene(K, t + {p!r} * h)" for p in places)
    times = ", ".join(f"t + {p!r} * h" for p in places)
    text.add(f"@inline\ndef gather(columns, i):\n    return ({entries})\n")
    text.add(
        f"@inline\ndef fly({state}, born, t, h, C, K):\n"
        f"    return advance({state}, t - born, C, {scene}, K[3], {times}, h)\n"
    )
    if motion.flows:
        carried = f"carried({state}, t - born, C, scene(K, t), K[3], t)"
        own = ("vx", "vy", "vz") if motion.inertial else ("0.0", "0.0", "0.0")
        body = f"    ux, uy, uz = {carried}\n"
        body += f"    return {own[0]} + ux, {own[1]} + uy, {own[2]} + uz\n"
    else:
        body = "    return vx, vy, vz\n"
    text.add(f"@inline\ndef total({state}, born, t, C, K):\n{body}")


def exceptions_kernel(
    module: dict[str, Any], solid: dict[str, Any], motion: Motion, surfaces: Surfaces | None
) -> Any:
    """The kernel that takes given rows from t (or their birth) to t + dt; it counts impacts.

    `solid` is the module of the solids, whose values are the kernel's `KS`.
    """
    gather, inertial = module["gather"], motion.inertial
    resolve = _free(module) if surfaces is None else _flight(module, solid, surfaces, inertial)

    @jit(flags=EXACT)
    def exceptions(position, velocity, birth, columns, rows, K, KS, t, dt):  # type: ignore[no-untyped-def]
        impacts = 0
        end = t + dt
        for r in range(rows.size):
            i = rows[r]
            x, y, z = triple(position, i)
            vx, vy, vz = triple(velocity, i) if inertial else (0.0, 0.0, 0.0)
            born = birth[i]
            x, y, z, vx, vy, vz, hits = resolve(
                x, y, z, vx, vy, vz, born, max(t, born), end, gather(columns, i), K, KS
            )
            impacts += hits
            position[0, i], position[1, i], position[2, i] = x, y, z
            if inertial:
                velocity[0, i], velocity[1, i], velocity[2, i] = vx, vy, vz
        return impacts

    return exceptions


def currents_kernel(module: dict[str, Any]) -> Any:
    """The kernel that gives the velocity with which flows carry every particle."""
    total, gather = module["total"], module["gather"]

    @jit(flags=EXACT)
    def currents(position, birth, columns, K, t, result):  # type: ignore[no-untyped-def]
        for i in range(result.shape[0]):
            x, y, z = triple(position, i)
            u = total(x, y, z, 0.0, 0.0, 0.0, birth[i], t, gather(columns, i), K)
            result[i, 0], result[i, 1], result[i, 2] = u

    return currents


@jit(flags=EXACT, inline=True)
def triple(block: Any, i: Any) -> Any:
    """One row of a (3, n) block as three doubles."""
    return np.float64(block[0, i]), np.float64(block[1, i]), np.float64(block[2, i])


def _free(module: dict[str, Any]) -> Any:
    """A flight that meets nothing."""
    fly = module["fly"]

    @jit(flags=EXACT, inline=True)
    def resolve(x, y, z, vx, vy, vz, born, t, end, C, K, KS):  # type: ignore[no-untyped-def]
        x, y, z, vx, vy, vz = fly(x, y, z, vx, vy, vz, born, t, end - t, C, K)
        return x, y, z, vx, vy, vz, 0

    return resolve


def _flight(
    module: dict[str, Any], solid: dict[str, Any], surfaces: Surfaces, inertial: bool
) -> Any:
    """A flight through impacts."""
    fly, total = module["fly"], module["total"]
    solids, scene, threatened = solid["solids"], solid["scene"], solid["threatened"]
    encounter, moving = encounter_kernel(solid, surfaces, inertial), surfaces.moving

    @jit(flags=EXACT, inline=True)
    def flight(x, y, z, vx, vy, vz, born, t, end, C, K, KS):  # type: ignore[no-untyped-def]
        # Not literals, for which Numba would compile `encounter` once more.
        hits, resting = np.int64(0), np.bool_(False)
        D = solids(scene(KS, t))
        while t < end:
            h = end - t
            a, b, c, va, vb, vc = fly(x, y, z, vx, vy, vz, born, t, h, C, K)
            if hits == 0 and not resting:
                E = solids(scene(KS, end)) if moving else D
                if not threatened(D, E, x, y, z, vx, vy, vz, a, b, c, va, vb, vc, h):
                    return a, b, c, va, vb, vc, hits
            w0 = total(x, y, z, vx, vy, vz, born, t, C, K)
            w1 = total(a, b, c, va, vb, vc, born, end, C, K)
            x, y, z, vx, vy, vz, t, hits, resting = encounter(
                x, y, z, w0, (a, b, c), w1, t, end, hits, resting, KS
            )
            u = total(x, y, z, 0.0, 0.0, 0.0, born, t, C, K)
            vx, vy, vz = vx - u[0], vy - u[1], vz - u[2]
        return x, y, z, vx, vy, vz, hits

    return flight
