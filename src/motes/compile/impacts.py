"""The exceptions pass: rows born in the step, and rows whose path might meet a solid.

One row at a time, in double precision. A row flies from its own beginning to the end of the step;
at an impact it is reflected and flies on (`compile/encounter.py`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.compile.advance import stage_times
from motes.compile.encounter import encounter_kernel, poses_at
from motes.compile.motion import Motion
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
    gather, fly, inertial = module["gather"], module["fly"], motion.inertial
    resolve = _free() if surfaces is None else _flight(module, solid, surfaces, inertial)
    posed, length = _posed(solid, surfaces), surfaces.length if surfaces else 1

    @jit(flags=EXACT)
    def exceptions(position, velocity, birth, columns, rows, K, KS, t, dt):  # type: ignore[no-untyped-def]
        impacts = 0
        end = t + dt
        D = np.empty(length)
        posed(KS, t, D)
        KP = (KS, D)
        for r in range(rows.size):
            i = rows[r]
            x, y, z = triple(position, i)
            vx, vy, vz = triple(velocity, i) if inertial else (0.0, 0.0, 0.0)
            born, C = birth[i], gather(columns, i)
            begin = max(t, born)
            ends = fly(x, y, z, vx, vy, vz, born, begin, end - begin, C, K)
            x, y, z, vx, vy, vz, hits = resolve(
                x, y, z, vx, vy, vz, ends, born, begin, end, C, K, KP, 0.0, 0.0, 0.0
            )
            impacts += hits
            position[0, i], position[1, i], position[2, i] = x, y, z
            if inertial:
                velocity[0, i], velocity[1, i], velocity[2, i] = vx, vy, vz
        return impacts

    return exceptions


def rebounds_kernel(
    module: dict[str, Any], solid: dict[str, Any], motion: Motion, surfaces: Surfaces
) -> Any:
    """The kernel that takes given rows of a group through their impacts.

    It returns the number of impacts, and of rows that do not end where the group's flight leads.
    `ends` (6, n) holds where the group's own flight leads and is overwritten. After an impact a row
    feels, beside the forces of its system, the mean push of the interactions over the step: what
    the group's flight has gained in velocity beyond those forces.
    """
    gather, fly = module["gather"], module["fly"]
    resolve = _flight(module, solid, surfaces, motion.inertial)
    posed, length = _posed(solid, surfaces), surfaces.length

    @jit(flags=EXACT)
    def rebounds(position, velocity, ends, birth, columns, rows, K, KS, t, dt):  # type: ignore[no-untyped-def]
        impacts, changed = 0, 0
        D = np.empty(length)
        posed(KS, t, D)
        KP = (KS, D)
        for r in range(rows.size):
            i = rows[r]
            x, y, z = triple(position, i)
            vx, vy, vz = triple(velocity, i)
            born, C = birth[i], gather(columns, i)
            a, b, c = triple(ends, i)
            va, vb, vc = triple(ends[3:], i)
            _, _, _, ux, uy, uz = fly(x, y, z, vx, vy, vz, born, t, dt, C, K)
            gx, gy, gz = (va - ux) / dt, (vb - uy) / dt, (vc - uz) / dt
            x, y, z, vx, vy, vz, hits = resolve(
                x, y, z, vx, vy, vz, (a, b, c, va, vb, vc), born, t, t + dt, C, K, KP, gx, gy, gz
            )
            impacts += hits
            same = (x == a) & (y == b) & (z == c) & (vx == va) & (vy == vb) & (vz == vc)
            changed += 0 if same else 1
            ends[0, i], ends[1, i], ends[2, i] = x, y, z
            ends[3, i], ends[4, i], ends[5, i] = vx, vy, vz
        return impacts, changed

    return rebounds


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


@jit(flags=EXACT, inline=True)
def _no_poses(KS: Any, t: Any, D: Any) -> None:
    """Where there is no solid."""
    D[0] = 0.0


def _posed(solid: dict[str, Any], surfaces: Surfaces | None) -> Any:
    """The function that writes the solids' poses at a time into an array."""
    if surfaces is None:
        return _no_poses
    scene, solids = solid["scene"], solid["solids"]

    @jit(flags=EXACT, inline=True)
    def posed(KS, t, D):  # type: ignore[no-untyped-def]
        now = solids(scene(KS, t))
        for i in range(D.size):
            D[i] = now[i]

    return posed


def _free() -> Any:
    """A flight that meets nothing."""

    @jit(flags=EXACT, inline=True)
    def resolve(x, y, z, vx, vy, vz, ends, born, t, end, C, K, KS, gx, gy, gz):  # type: ignore[no-untyped-def]
        a, b, c, va, vb, vc = ends
        return a, b, c, va, vb, vc, 0

    return resolve


def _flight(
    module: dict[str, Any], solid: dict[str, Any], surfaces: Surfaces, inertial: bool
) -> Any:
    """A flight through impacts, from an undisturbed one that would lead to `ends`.

    After an impact the row flies on with the forces of its system and a push (gx, gy, gz) [m/s2].
    """
    fly, total = module["fly"], module["total"]
    threatened, poses = solid["threatened"], poses_at(solid, surfaces)
    encounter, moving = encounter_kernel(solid, surfaces, inertial), surfaces.moving

    @jit(flags=EXACT, inline=True)
    def flight(x, y, z, vx, vy, vz, ends, born, t, end, C, K, KS, gx, gy, gz):  # type: ignore[no-untyped-def]
        # Not literals, for which Numba would compile `encounter` once more.
        hits, resting = np.int64(0), np.bool_(False)
        a, b, c, va, vb, vc = ends
        D = poses(KS, t)
        E = poses(KS, end) if moving else D
        if not threatened(D, E, x, y, z, vx, vy, vz, a, b, c, va, vb, vc, end - t):
            return a, b, c, va, vb, vc, hits
        while t < end:
            w0 = total(x, y, z, vx, vy, vz, born, t, C, K)
            w1 = total(a, b, c, va, vb, vc, born, end, C, K)
            x, y, z, vx, vy, vz, t, hits, resting = encounter(
                x, y, z, w0, (a, b, c), w1, t, end, hits, resting, KS
            )
            u = total(x, y, z, 0.0, 0.0, 0.0, born, t, C, K)
            vx, vy, vz = vx - u[0], vy - u[1], vz - u[2]
            if t < end:
                h = end - t
                a, b, c, va, vb, vc = fly(x, y, z, vx, vy, vz, born, t, h, C, K)
                m = 0.5 * h * h
                a, b, c = a + m * gx, b + m * gy, c + m * gz
                va, vb, vc = va + h * gx, vb + h * gy, vc + h * gz
        return x, y, z, vx, vy, vz, hits

    return flight
