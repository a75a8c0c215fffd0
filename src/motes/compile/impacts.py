"""The exceptions pass: rows born in the step, and rows whose path might meet a solid.

One row at a time, in double precision. A row flies from its own beginning to the end of the step;
at an impact, found on the cubic Hermite polynomial of the flight, its velocity is reflected and it
flies on. Bounces that would be shorter than a thousandth of the flight's rest are no longer
resolved: the row slides on the surface, held by friction (the guard against Zeno's paradox).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.compile.motion import Motion, stage_times
from motes.compile.surfaces import HEAD, POSE, Surfaces
from motes.compile.text import STATE, Text
from motes.jit import EXACT, jit

BOUNCES = 64
"""Impacts of one row in one step before it slides."""

SHORT = 1e-3
"""Bounces shorter than this share of the remaining step are not resolved."""

TOUCH = 1e-9
"""Distance at which a point touches, relative to its coordinates and 1 m."""

SAMPLES = 32
"""Shortest search step, as a share of the flight: thinner solids could be missed."""

SLOPE = 1e-6
"""Distance over which normals are measured, relative to the coordinates and 1 m."""


def write_flight(text: Text, motion: Motion) -> None:
    """Write `gather`, `fly` (one step of any length at any time) and `total` (velocity and flow)."""
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
        body = f"    ux, uy, uz = {carried}\n    return {own[0]} + ux, {own[1]} + uy, {own[2]} + uz\n"
    else:
        body = "    return vx, vy, vz\n"
    text.add(f"@inline\ndef total({state}, born, t, C, K):\n{body}")


def exceptions_kernel(module: dict[str, Any], motion: Motion, surfaces: Surfaces | None) -> Any:
    """The kernel that takes given rows from t (or their birth) to t + dt; it counts impacts."""
    fly, gather = module["fly"], module["gather"]
    inertial = motion.inertial
    flight = _flight(module, surfaces, inertial) if surfaces else None
    resolve = flight if flight is not None else _free(fly)

    @jit(flags=EXACT)
    def exceptions(position, velocity, birth, columns, rows, K, t, dt):  # type: ignore[no-untyped-def]
        impacts = 0
        end = t + dt
        for r in range(rows.size):
            i = rows[r]
            x, y, z = np.float64(position[0, i]), np.float64(position[1, i]), np.float64(position[2, i])
            vx, vy, vz = 0.0, 0.0, 0.0
            if inertial:
                vx, vy, vz = np.float64(velocity[0, i]), np.float64(velocity[1, i]), np.float64(velocity[2, i])
            born = birth[i]
            C = gather(columns, i)
            x, y, z, vx, vy, vz, hits = resolve(
                x, y, z, vx, vy, vz, born, max(t, born), end, C, K
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
            x, y, z = np.float64(position[0, i]), np.float64(position[1, i]), np.float64(position[2, i])
            C = gather(columns, i)
            u = total(x, y, z, 0.0, 0.0, 0.0, birth[i], t, C, K)
            result[i, 0], result[i, 1], result[i, 2] = u

    return currents


def _free(fly: Any) -> Any:
    """A flight that meets nothing."""

    @jit(flags=EXACT, inline=True)
    def resolve(x, y, z, vx, vy, vz, born, t, end, C, K):  # type: ignore[no-untyped-def]
        x, y, z, vx, vy, vz = fly(x, y, z, vx, vy, vz, born, t, end - t, C, K)
        return x, y, z, vx, vy, vz, 0

    return resolve


def _flight(module: dict[str, Any], surfaces: Surfaces, inertial: bool) -> Any:
    """A flight through impacts."""
    fly, total, scene, solids = (module[n] for n in ("fly", "total", "scene", "solids"))
    near, moved, threatened = (module[n] for n in ("near", "moved", "threatened"))
    starts, moving = surfaces.starts, surfaces.moving

    @jit(flags=EXACT, inline=True)
    def gap(x, y, z, t, D, K):  # type: ignore[no-untyped-def]
        if moving:
            d, _ = near(solids(scene(K, t)), x, y, z)
        else:
            d, _ = near(D, x, y, z)
        return d

    @jit(flags=EXACT)
    def touch(x, y, z, t, K):  # type: ignore[no-untyped-def]
        """Distance, normal, surface velocity, restitution and friction at a point and time."""
        D = solids(scene(K, t))
        d, which = near(D, x, y, z)
        e = SLOPE * (1.0 + abs(x) + abs(y) + abs(z))
        nx = near(D, x + e, y, z)[0] - near(D, x - e, y, z)[0]
        ny = near(D, x, y + e, z)[0] - near(D, x, y - e, z)[0]
        nz = near(D, x, y, z + e)[0] - near(D, x, y, z - e)[0]
        n = np.sqrt(nx * nx + ny * ny + nz * nz)
        if n > 0.0:
            nx, ny, nz = nx / n, ny / n, nz / n
        else:
            nx, ny, nz = 0.0, 0.0, 1.0
        k = starts[which]
        sx, sy, sz = 0.0, 0.0, 0.0
        if moving:
            m = 1e-5
            ax, ay, az = moved(D, solids(scene(K, t - m)), k, x, y, z)
            bx, by, bz = moved(D, solids(scene(K, t + m)), k, x, y, z)
            sx, sy, sz = (bx - ax) / (2 * m), (by - ay) / (2 * m), (bz - az) / (2 * m)
        return d, nx, ny, nz, sx, sy, sz, D[k + POSE], D[k + HEAD - 1]

    @jit(flags=EXACT)
    def first_impact(x, y, z, w0, p1, w1, t, h, g, start, D, K):  # type: ignore[no-untyped-def]
        """Instant of the first impact as a share of the flight, or 2 if there is none."""
        fastest = h * max(
            np.sqrt(w0[0] ** 2 + w0[1] ** 2 + w0[2] ** 2),
            np.sqrt(w1[0] ** 2 + w1[1] ** 2 + w1[2] ** 2),
        )
        leg = 0.0
        for a, b, c, d in ((x, p1[0], w0[0], w1[0]), (y, p1[1], w0[1], w1[1]),
                           (z, p1[2], w0[2], w1[2])):  # fmt: skip
            leg += (3.0 * (b - a) - h * (c + d)) ** 2
        fastest = max(fastest, np.sqrt(leg)) + 1e-300
        s = start
        while s < 1.0:
            after = min(s + max(g / fastest if not moving else 0.0, 1.0 / SAMPLES), 1.0)
            a, b, c = hermite(x, y, z, w0, p1, w1, h, after)
            ahead = gap(a, b, c, t + after * h, D, K)
            if ahead < 0.0:
                return root(x, y, z, w0, p1, w1, t, h, s, g, after, ahead, D, K)
            s, g = after, ahead
        return 2.0

    @jit(flags=EXACT, inline=True)
    def root(x, y, z, w0, p1, w1, t, h, low, above, high, below, D, K):  # type: ignore[no-untyped-def]
        """Where the gap closes between two instants (regula falsi, Illinois variant)."""
        side = 0
        for _ in range(80):
            if high - low < 1e-14:
                break
            s = (low * below - high * above) / (below - above)
            if not low < s < high:
                s = 0.5 * (low + high)
            a, b, c = hermite(x, y, z, w0, p1, w1, h, s)
            g = gap(a, b, c, t + s * h, D, K)
            if abs(g) < 1e-15:
                return s
            if g > 0.0:
                low, above = s, g
                below = 0.5 * below if side == 1 else below
                side = 1
            else:
                high, below = s, g
                above = 0.5 * above if side == -1 else above
                side = -1
        return low

    @jit(flags=EXACT, inline=True)
    def reflect(x, y, z, w, contact, resting):  # type: ignore[no-untyped-def]
        """Total velocity after an impact or in resting contact, and whether it went inward."""
        _, nx, ny, nz, sx, sy, sz, restitution, friction = contact
        rx, ry, rz = w[0] - sx, w[1] - sy, w[2] - sz
        inward = rx * nx + ry * ny + rz * nz
        if inward >= 0.0:
            return w[0], w[1], w[2]
        tx, ty, tz = rx - inward * nx, ry - inward * ny, rz - inward * nz
        along = np.sqrt(tx * tx + ty * ty + tz * tz)
        change = -inward if resting else -(1.0 + restitution) * inward
        keep = max(1.0 - friction * change / along, 0.0) if along > 0.0 else 0.0
        out = inward + change
        return sx + keep * tx + out * nx, sy + keep * ty + out * ny, sz + keep * tz + out * nz

    @jit(flags=EXACT, inline=True)
    def flight(x, y, z, vx, vy, vz, born, t, end, C, K):  # type: ignore[no-untyped-def]
        D = solids(scene(K, t))
        hits = 0
        resting = False
        while True:
            h = end - t
            if h <= 0.0:
                break
            a, b, c, va, vb, vc = fly(x, y, z, vx, vy, vz, born, t, h, C, K)
            if resting:
                x, y, z, vx, vy, vz = a, b, c, va, vb, vc
                for _ in range(4):
                    contact = touch(x, y, z, end, K)
                    d = contact[0]
                    if d > TOUCH * (1.0 + abs(x) + abs(y) + abs(z)):
                        break
                    x, y, z = x - d * contact[1], y - d * contact[2], z - d * contact[3]
                    if inertial:
                        w = total(x, y, z, vx, vy, vz, born, end, C, K)
                        r = reflect(x, y, z, w, contact, True)
                        vx, vy, vz = vx + r[0] - w[0], vy + r[1] - w[1], vz + r[2] - w[2]
                break
            if hits == 0 and not threatened(
                D, D if not moving else solids(scene(K, end)), x, y, z, vx, vy, vz,
                a, b, c, va, vb, vc, h,
            ):  # fmt: skip
                x, y, z, vx, vy, vz = a, b, c, va, vb, vc
                break
            w0 = total(x, y, z, vx, vy, vz, born, t, C, K)
            w1 = total(a, b, c, va, vb, vc, born, end, C, K)
            g = gap(x, y, z, t, D, K)
            near_by = TOUCH * (1.0 + abs(x) + abs(y) + abs(z))
            start = 0.0
            if g <= near_by:
                contact = touch(x, y, z, t, K)
                _, nx, ny, nz, sx, sy, sz, _, _ = contact
                out = (w0[0] - sx) * nx + (w0[1] - sy) * ny + (w0[2] - sz) * nz
                pull = ((w1[0] - w0[0]) * nx + (w1[1] - w0[1]) * ny + (w1[2] - w0[2]) * nz) / h
                if g < -near_by:
                    x, y, z = x - g * nx, y - g * ny, z - g * nz
                    if out >= 0.0:
                        if hits >= BOUNCES:
                            resting = True
                        hits += 1
                        continue
                if out < 0.0:
                    start = -1.0
                elif pull < 0.0 or moving:
                    if moving and pull >= 0.0:
                        start = 1e-6
                    elif 2.0 * out <= SHORT * -pull * h:
                        resting = True
                        continue
                    else:
                        start = min(out / (-pull * h), 1.0)
                    a1, b1, c1 = hermite(x, y, z, w0, (a, b, c), w1, h, start)
                    g = gap(a1, b1, c1, t + start * h, D, K)
                    if g < 0.0:
                        resting = True
                        continue
            s = 0.0
            if start >= 0.0:
                s = first_impact(x, y, z, w0, (a, b, c), w1, t, h, g, start, D, K)
            if s > 1.0:
                x, y, z, vx, vy, vz = a, b, c, va, vb, vc
                break
            wx, wy, wz = hermite_slope(x, y, z, w0, (a, b, c), w1, h, s)
            x, y, z = hermite(x, y, z, w0, (a, b, c), w1, h, s)
            t = t + s * h
            contact = touch(x, y, z, t, K)
            x, y, z = x - contact[0] * contact[1], y - contact[0] * contact[2], z - contact[0] * contact[3]
            if not inertial:
                resting = True
                hits += 1
                continue
            out = -((wx - contact[4]) * contact[1] + (wy - contact[5]) * contact[2]
                    + (wz - contact[6]) * contact[3]) * contact[7]  # fmt: skip
            pull = ((w1[0] - w0[0]) * contact[1] + (w1[1] - w0[1]) * contact[2]
                    + (w1[2] - w0[2]) * contact[3]) / h  # fmt: skip
            resting = hits >= BOUNCES or 2.0 * out <= SHORT * -pull * (end - t)
            r = reflect(x, y, z, (wx, wy, wz), contact, resting)
            u = total(x, y, z, 0.0, 0.0, 0.0, born, t, C, K)
            vx, vy, vz = r[0] - u[0], r[1] - u[1], r[2] - u[2]
            hits += 1
        return x, y, z, vx, vy, vz, hits

    return flight


@jit(flags=EXACT, inline=True)
def hermite(x: Any, y: Any, z: Any, w0: Any, p1: Any, w1: Any, h: Any, s: Any) -> Any:
    """Point at share s of a flight of length h from (x, y, z) with velocity w0 to p1 with w1."""
    a = s * s * (3.0 - 2.0 * s)
    b = h * s * (1.0 - s) * (1.0 - s)
    c = -h * s * s * (1.0 - s)
    return (
        x + a * (p1[0] - x) + b * w0[0] + c * w1[0],
        y + a * (p1[1] - y) + b * w0[1] + c * w1[1],
        z + a * (p1[2] - z) + b * w0[2] + c * w1[2],
    )


@jit(flags=EXACT, inline=True)
def hermite_slope(x: Any, y: Any, z: Any, w0: Any, p1: Any, w1: Any, h: Any, s: Any) -> Any:
    """Velocity at share s of that flight."""
    a = 6.0 * s * (1.0 - s) / h
    b = (1.0 - s) * (1.0 - 3.0 * s)
    c = s * (3.0 * s - 2.0)
    return (
        a * (p1[0] - x) + b * w0[0] + c * w1[0],
        a * (p1[1] - y) + b * w0[1] + c * w1[1],
        a * (p1[2] - z) + b * w0[2] + c * w1[2],
    )
