"""Encounters of a path with the solids: the first impact, the bounce, the rest.

Nothing here depends on what moves a particle, so that a change of forces leaves this machine code
as it is. A path is the cubic Hermite polynomial of a flight that would reach the step's end
undisturbed. At an impact the velocity is reflected, with restitution and Coulomb friction. Bounces
that would be shorter than a thousandth of the flight's rest are no longer resolved: the row slides
on the surface, held by friction (the guard against Zeno's paradox).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.compile.surfaces import HEAD, POSE, Surfaces
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

MOMENT = 1e-5
"""Half the time [s] over which a surface's own velocity is measured."""


def encounter_kernel(solid: dict[str, Any], surfaces: Surfaces, inertial: bool) -> Any:
    """The function that takes a row along its path to the first impact, or to the end.

    `encounter(x, y, z, w0, p1, w1, t, end, hits, resting, KS)`: from a point with total velocity w0
    at time t towards p1 with w1. It returns the point, total velocity and time that are reached,
    the impacts so far, and whether the row slides from now on.
    """
    gap, touch = _probes(solid, surfaces)
    first_impact = _search(gap)
    moving = surfaces.moving

    @jit(flags=EXACT)
    def rest(x, y, z, w, t, KS):  # type: ignore[no-untyped-def]
        """Slide: out of the solids, without velocity into them."""
        wx, wy, wz = w
        for _ in range(4):
            contact = touch(x, y, z, t, KS)
            d, nx, ny, nz = contact[:4]
            if d > touching(x, y, z):
                break
            x, y, z = x - d * nx, y - d * ny, z - d * nz
            settled = d >= -touching(x, y, z)
            if inertial:
                ux, uy, uz = reflect(wx, wy, wz, contact, 0.0)
                settled = settled & (ux == wx) & (uy == wy) & (uz == wz)
                wx, wy, wz = ux, uy, uz
            if settled:
                break
        return x, y, z, wx, wy, wz

    @jit(flags=EXACT)
    def encounter(x, y, z, w0, p1, w1, t, end, hits, resting, KS):  # type: ignore[no-untyped-def]
        h = end - t
        if resting:
            x, y, z, wx, wy, wz = rest(p1[0], p1[1], p1[2], w1, end, KS)
            return x, y, z, wx, wy, wz, end, hits, resting
        g = gap(x, y, z, t, KS)
        start = 0.0
        if g <= touching(x, y, z):
            _, nx, ny, nz, sx, sy, sz, _, _ = touch(x, y, z, t, KS)
            out = (w0[0] - sx) * nx + (w0[1] - sy) * ny + (w0[2] - sz) * nz
            pull = ((w1[0] - w0[0]) * nx + (w1[1] - w0[1]) * ny + (w1[2] - w0[2]) * nz) / h
            if g < -touching(x, y, z):
                x, y, z = x - g * nx, y - g * ny, z - g * nz
                if out >= 0.0:
                    return x, y, z, w0[0], w0[1], w0[2], t, hits + 1, hits >= BOUNCES
            if out < 0.0:
                start = -1.0
            elif pull < 0.0 or moving:
                if moving and pull >= 0.0:
                    start = 1e-6
                elif 2.0 * out <= SHORT * -pull * h:
                    x, y, z, wx, wy, wz = rest(p1[0], p1[1], p1[2], w1, end, KS)
                    return x, y, z, wx, wy, wz, end, hits, True
                else:
                    start = min(out / (-pull * h), 1.0)
                a, b, c = hermite(x, y, z, w0, p1, w1, h, start)
                g = gap(a, b, c, t + start * h, KS)
                if g < 0.0:
                    x, y, z, wx, wy, wz = rest(p1[0], p1[1], p1[2], w1, end, KS)
                    return x, y, z, wx, wy, wz, end, hits, True
        s = 0.0
        if start >= 0.0:
            s = first_impact(x, y, z, w0, p1, w1, t, h, g, start, moving, KS)
        if s > 1.0:
            return p1[0], p1[1], p1[2], w1[0], w1[1], w1[2], end, hits, False
        wx, wy, wz = hermite_slope(x, y, z, w0, p1, w1, h, s)
        x, y, z = hermite(x, y, z, w0, p1, w1, h, s)
        t += s * h
        contact = touch(x, y, z, t, KS)
        d, nx, ny, nz, sx, sy, sz, restitution, _ = contact
        x, y, z = x - d * nx, y - d * ny, z - d * nz
        if inertial:
            out = -restitution * ((wx - sx) * nx + (wy - sy) * ny + (wz - sz) * nz)
            pull = ((w1[0] - w0[0]) * nx + (w1[1] - w0[1]) * ny + (w1[2] - w0[2]) * nz) / h
            resting = hits >= BOUNCES or 2.0 * out <= SHORT * -pull * (end - t)
            wx, wy, wz = reflect(wx, wy, wz, contact, 0.0 if resting else restitution)
        else:
            resting = True
        return x, y, z, wx, wy, wz, t, hits + 1, resting

    return encounter


def poses_at(solid: dict[str, Any], surfaces: Surfaces) -> Any:
    """The function of KS, the solids' numbers and their poses at one time, and of a time.

    It gives the tuple D of the solids, or what KS holds of it where no solid ever moves.
    """
    scene, solids = solid["scene"], solid["solids"]
    if surfaces.moving:

        @jit(flags=EXACT, inline=True)
        def poses(KS, t):  # type: ignore[no-untyped-def]
            return solids(scene(KS[0], t))

    else:

        @jit(flags=EXACT, inline=True)
        def poses(KS, t):  # type: ignore[no-untyped-def]
            return KS[1]

    return poses


def _probes(solid: dict[str, Any], surfaces: Surfaces) -> tuple[Any, Any]:
    """`gap`: the distance of a point at a time; `touch`: that and all that a contact needs."""
    near, moved = solid["near"], solid["moved"]
    poses, starts, moving = poses_at(solid, surfaces), surfaces.starts, surfaces.moving

    @jit(flags=EXACT)
    def gap(x, y, z, t, KS):  # type: ignore[no-untyped-def]
        return near(poses(KS, t), x, y, z)[0]

    @jit(flags=EXACT)
    def touch(x, y, z, t, KS):  # type: ignore[no-untyped-def]
        """Distance, normal, surface velocity, restitution and friction at a point and time."""
        D = poses(KS, t)
        d, which = near(D, x, y, z)
        e = SLOPE * (1.0 + abs(x) + abs(y) + abs(z))
        nx = gap(x + e, y, z, t, KS) - gap(x - e, y, z, t, KS)
        ny = gap(x, y + e, z, t, KS) - gap(x, y - e, z, t, KS)
        nz = gap(x, y, z + e, t, KS) - gap(x, y, z - e, t, KS)
        n = np.sqrt(nx * nx + ny * ny + nz * nz)
        if n > 0.0:
            nx, ny, nz = nx / n, ny / n, nz / n
        else:
            nx, ny, nz = 0.0, 0.0, 1.0
        k = starts[which]
        sx, sy, sz = 0.0, 0.0, 0.0
        if moving:
            ax, ay, az = moved(D, poses(KS, t - MOMENT), k, x, y, z)
            bx, by, bz = moved(D, poses(KS, t + MOMENT), k, x, y, z)
            m = 0.5 / MOMENT
            sx, sy, sz = m * (bx - ax), m * (by - ay), m * (bz - az)
        return d, nx, ny, nz, sx, sy, sz, D[k + POSE], D[k + HEAD - 1]

    return gap, touch


def _search(gap: Any) -> Any:
    """The search for the first impact by steps that no distance function lets go too far."""

    @jit(flags=EXACT)
    def first_impact(x, y, z, w0, p1, w1, t, h, g, start, moving, KS):  # type: ignore[no-untyped-def]
        """Instant of the first impact as a share of the flight, or 2 if there is none."""
        ax, ay, az = p1[0] - x, p1[1] - y, p1[2] - z
        bx, by, bz = w0[0] + w1[0], w0[1] + w1[1], w0[2] + w1[2]
        fastest = length(3.0 * ax - h * bx, 3.0 * ay - h * by, 3.0 * az - h * bz)
        fastest = max(fastest, h * length(w0[0], w0[1], w0[2]))
        fastest = max(fastest, h * length(w1[0], w1[1], w1[2]))
        low = start
        while low < 1.0:
            high = min(low + max(0.0 if moving else g / (fastest + 1e-300), 1.0 / SAMPLES), 1.0)
            a, b, c = hermite(x, y, z, w0, p1, w1, h, high)
            below = gap(a, b, c, t + high * h, KS)
            if below < 0.0:
                break
            low, g = high, below
        if low >= 1.0:
            return 2.0
        # The gap closes between low and high: regula falsi, Illinois variant.
        side = 0
        for _ in range(80):
            if high - low < 1e-14:
                break
            s = (low * below - high * g) / (below - g)
            if not low < s < high:
                s = 0.5 * (low + high)
            a, b, c = hermite(x, y, z, w0, p1, w1, h, s)
            d = gap(a, b, c, t + s * h, KS)
            if abs(d) < 1e-15:
                return s
            if d > 0.0:
                low, g = s, d
                below = 0.5 * below if side == 1 else below
                side = 1
            else:
                high, below = s, d
                g = 0.5 * g if side == -1 else g
                side = -1
        return low

    return first_impact


@jit(flags=EXACT, inline=True)
def touching(x: Any, y: Any, z: Any) -> Any:
    """Distance at which a point counts as touching."""
    return TOUCH * (1.0 + abs(x) + abs(y) + abs(z))


@jit(flags=EXACT, inline=True)
def length(x: Any, y: Any, z: Any) -> Any:
    """Length of a vector."""
    return np.sqrt(x * x + y * y + z * z)


@jit(flags=EXACT)
def reflect(wx: Any, wy: Any, wz: Any, contact: Any, restitution: Any) -> Any:
    """Total velocity after an impact, or in resting contact (restitution 0)."""
    _, nx, ny, nz, sx, sy, sz, _, friction = contact
    rx, ry, rz = wx - sx, wy - sy, wz - sz
    inward = rx * nx + ry * ny + rz * nz
    if inward >= 0.0:
        return wx, wy, wz
    tx, ty, tz = rx - inward * nx, ry - inward * ny, rz - inward * nz
    along = length(tx, ty, tz)
    change = -(1.0 + restitution) * inward
    keep = max(1.0 - friction * change / along, 0.0) if along > 0.0 else 0.0
    out = inward + change
    return sx + keep * tx + out * nx, sy + keep * ty + out * ny, sz + keep * tz + out * nz


@jit(flags=EXACT)
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


@jit(flags=EXACT)
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
