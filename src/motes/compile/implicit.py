"""Implicit methods for particles: Newton's method for the velocity of one stage of one particle.

A stage is X = p + g V, V = q + g A(X, V), with p and q known and g its own share of the step. X is
put into the second equation, which leaves three unknowns; their matrix
1 - g dA/dV - g^2 dA/dX comes from differences at the stage's start. Rows are solved one by one, as
far as each needs.
"""

from __future__ import annotations

from collections.abc import Sequence

from motes.compile.text import AXES, STATE
from motes.tableau import Implicit

ITERATIONS = 20

QUIET = "F(0.0), F(0.0), F(0.0)"
"""No further acceleration."""

FELT = """
@inline
def felt(x, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t):
    ax, ay, az, r, bx, by, bz = pushed(x, y, z, vx, vy, vz, age, C, S, L, t)
    ax, ay, az = ax + gx, ay + gy, az + gz
LIMITED
    return ax + bx - r * vx, ay + by - r * vy, az + bz - r * vz
"""
"""The acceleration with all that acts; g is a further one, what other particles cause."""

SETTLE = """
@inline
def settle(px, py, pz, qx, qy, qz, gx, gy, gz, g, age, C, S, L, t):
    vx, vy, vz = qx, qy, qz
    x, y, z = px + g * vx, py + g * vy, pz + g * vz
    ax, ay, az = felt(x, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    d = F(ROOT) * (F(1.0) + abs(x) + abs(y) + abs(z))
    w = F(ROOT) * (F(1.0) + abs(vx) + abs(vy) + abs(vz))
    fx, fy, fz = felt(x + d, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    hx, hy, hz = felt(x, y, z, vx + w, vy, vz, gx, gy, gz, age, C, S, L, t)
    c, e = g * g / d, g / w
    m00 = F(1.0) - c * (fx - ax) - e * (hx - ax)
    m10 = -c * (fy - ay) - e * (hy - ay)
    m20 = -c * (fz - az) - e * (hz - az)
    fx, fy, fz = felt(x, y + d, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    hx, hy, hz = felt(x, y, z, vx, vy + w, vz, gx, gy, gz, age, C, S, L, t)
    m01 = -c * (fx - ax) - e * (hx - ax)
    m11 = F(1.0) - c * (fy - ay) - e * (hy - ay)
    m21 = -c * (fz - az) - e * (hz - az)
    fx, fy, fz = felt(x, y, z + d, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    hx, hy, hz = felt(x, y, z, vx, vy, vz + w, gx, gy, gz, age, C, S, L, t)
    m02 = -c * (fx - ax) - e * (hx - ax)
    m12 = -c * (fy - ay) - e * (hy - ay)
    m22 = F(1.0) - c * (fz - az) - e * (hz - az)
    i00, i01, i02 = m11 * m22 - m12 * m21, m02 * m21 - m01 * m22, m01 * m12 - m02 * m11
    i10, i11, i12 = m12 * m20 - m10 * m22, m00 * m22 - m02 * m20, m02 * m10 - m00 * m12
    i20, i21, i22 = m10 * m21 - m11 * m20, m01 * m20 - m00 * m21, m00 * m11 - m01 * m10
    s = F(1.0) / (m00 * i00 + m01 * i10 + m02 * i20)
    last, size = F(1e30), F(1e30)
    for _ in range(ITERATIONS):
        rx, ry, rz = qx + g * ax - vx, qy + g * ay - vy, qz + g * az - vz
        dx = s * (i00 * rx + i01 * ry + i02 * rz)
        dy = s * (i10 * rx + i11 * ry + i12 * rz)
        dz = s * (i20 * rx + i21 * ry + i22 * rz)
        vx += dx
        vy += dy
        vz += dz
        size = abs(dx) + abs(dy) + abs(dz)
        x, y, z = px + g * vx, py + g * vy, pz + g * vz
        if size <= F(NEAR) * (abs(vx) + abs(vy) + abs(vz)) or not size < last:
            break
        last = size
        ax, ay, az = felt(x, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    # Where rounding ended it, that is as near as can be; elsewhere there is no solution.
    whole = abs(vx) + abs(vy) + abs(vz) + abs(qx) + abs(qy) + abs(qz)
    if not size <= F(1e-3) * whole:
        vx = F(1e309)
    return x, y, z, vx, vy, vz
"""
"""`settle` gives the state of a stage."""


def epsilon(precision: str) -> float:
    """Distance of 1 from the next number."""
    return 2.0**-23 if precision == "single" else 2.0**-52


def felt_text(limits: bool, name: str = "felt", pushed: str = "pushed") -> str:
    """The function `felt`; `limits` says whether anything limits accelerations."""
    limited = "ax, ay, az = limited(x, y, z, vx, vy, vz, age, C, S, L, t, ax, ay, az)"
    text = FELT.replace("LIMITED\n", f"    {limited}\n" if limits else "")
    return text.replace("felt", name).replace("pushed", pushed)


def settle_text(precision: str) -> str:
    """The function `settle` for a precision."""
    least = epsilon(precision)
    text = SETTLE.replace("ROOT", repr(least**0.5)).replace("NEAR", repr(least))
    return text.replace("ITERATIONS", str(ITERATIONS))


def stages(method: Implicit) -> tuple[int, ...]:
    """The stages that a step with a fixed length needs."""
    return tuple(i for i in range(len(method.b)) if i not in method.spare_stages)


def advance_lines(method: Implicit, split: bool = False) -> tuple[str, list[str]]:
    """Source of a step, stage by stage, and its ends; slopes are kx0, kvx0 ...

    A `split` method takes the forces of `felt` implicitly, those of `eased` explicitly, with the
    slopes fvx0 ...
    """
    needed = stages(method)
    lines = ""
    for place, i in enumerate(needed):
        terms = {
            n: [(f"k{n}{needed.index(j)}", w) for j, w in _entries(method.a[i][:i])] for n in STATE
        }
        if split:
            for n in STATE[3:]:
                terms[n] += [
                    (f"f{n}{needed.index(j)}", w) for j, w in _entries(method.a_explicit[i])
                ]
        base = [f"p{n}{place}" for n in STATE]
        lines += "".join(
            f"    {b} = {_combined(n, terms[n])}\n" for b, n in zip(base, STATE, strict=True)
        )
        age = f"age + F({float(method.c[i])!r}) * h"
        call = f"{age}, C, S{place}, L, t{place}"
        own = method.a[i][i]
        state = [f"e{n}{place}" for n in STATE] if own else base
        if own:
            lines += f"    g = F({float(own)!r}) * h\n"
            lines += f"    {', '.join(state)} = settle({', '.join(base)}, {QUIET}, g, {call})\n"
            lines += "".join(f"    k{n}{place} = (e{n}{place} - p{n}{place}) / g\n" for n in STATE)
        else:
            lines += f"    ux, uy, uz = carried({', '.join(base)}, {call})\n"
            lines += "".join(f"    k{a}{place} = pv{a}{place} + u{a}\n" for a in AXES)
            slopes = ", ".join(f"kv{a}{place}" for a in AXES)
            lines += f"    {slopes} = felt({', '.join(base)}, {QUIET}, {call})\n"
        if split:
            slopes = ", ".join(f"fv{a}{place}" for a in AXES)
            lines += f"    {slopes} = eased({', '.join(state)}, {QUIET}, {call})\n"
    ends = []
    for n in STATE:
        letters = "kf" if split and n in STATE[3:] else "k"
        weights = [(f"{s}{n}{needed.index(j)}", w) for s in letters for j, w in _entries(method.b)]
        ends.append(_combined(n, weights))
    return lines, ends


PAST = """
@inline
def weights_of_past(h, inverse):
    w = h * inverse
    whole = F(1.0) + F(2.0) * w
    return w * w / whole, h * (F(1.0) + w) / whole
"""
"""The second backward difference formula is y1 = y0 + c (y0 - y_before) + g f(y1). A row remembers
its last change, and the inverse length of that step, 0 where it has no past: then the ratio w of
the steps is 0, and the step is backward Euler's."""


def proceed_lines() -> tuple[str, list[str]]:
    """Source of a step of that formula, with the past p0 ... p6, and its ends."""
    lines = "    c, g = weights_of_past(h, p6)\n"
    base = ", ".join(f"{n} + c * p{k}" for k, n in enumerate(STATE))
    ends = [f"e{n}" for n in STATE]
    lines += f"    {', '.join(ends)} = settle({base}, {QUIET}, g, age + h, C, S1, L, t1)\n"
    return lines, ends


def _entries(row: Sequence[float]) -> list[tuple[int, float]]:
    """Those numbers of a row that are not 0, with their places."""
    return [(j, float(w)) for j, w in enumerate(row) if w]


def _combined(name: str, terms: list[tuple[str, float]]) -> str:
    total = " + ".join(f"F({w!r}) * {slope}" for slope, w in terms)
    return f"{name} + h * ({total})" if terms else name
