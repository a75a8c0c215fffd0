"""Methods that need the whole matrix of one particle's equations of motion.

The state is Y = (x, v), its slope F = (v + u(Y), A(Y)). `linearise` gives dF/dY by central
differences, to 1e-9 of the forces in double precision and 1e-4 in single. Stages that belong
together (radau5) are found by iteration with it, Rosenbrock methods take it as it is.
"""

from __future__ import annotations

from motes.compile.implicit import ITERATIONS, QUIET, epsilon, stages
from motes.compile.text import STATE
from motes.tableau import Implicit, Rosenbrock

LINEARISE = """
@inline
def rate(x, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t):
    ux, uy, uz = carried(x, y, z, vx, vy, vz, age, C, S, L, t)
    ax, ay, az = felt(x, y, z, vx, vy, vz, gx, gy, gz, age, C, S, L, t)
    return vx + ux, vy + uy, vz + uz, ax, ay, az


@inline
def linearise(x, y, z, vx, vy, vz, gx, gy, gz, J, age, C, S, L, t):
    Y = empty(6, F)
    Y[0], Y[1], Y[2], Y[3], Y[4], Y[5] = x, y, z, vx, vy, vz
    d = F(SHIFT) * (F(1.0) + abs(x) + abs(y) + abs(z))
    w = F(SHIFT) * (F(1.0) + abs(vx) + abs(vy) + abs(vz))
    for k in range(6):
        old, shift = Y[k], d if k < 3 else w
        for side in range(2):
            Y[k] = old + (shift if side == 1 else -shift)
            f = rate(Y[0], Y[1], Y[2], Y[3], Y[4], Y[5], gx, gy, gz, age, C, S, L, t)
            share = (F(0.5) if side == 1 else F(-0.5)) / shift
            for r, part in enumerate(f):
                before = J[6 * r + k] if side == 1 else F(0.0)
                J[6 * r + k] = before + share * part
        Y[k] = old
"""
"""`rate` is F with a further acceleration g; `linearise` writes dF/dY, row by row, into J."""

TOGETHER = """
@inline
def together(x, y, z, vx, vy, vz, G, k, h, age, C, SCENE, L, TIMES):
    J, M, pivots, r = empty(36, F), empty(SIZE * SIZE, F), empty(SIZE, F), empty(SIZE, F)
    a = empty((STAGES, STAGES), F)
TABLE
    linearise(x, y, z, vx, vy, vz, G[0], G[1], G[2], J, age, C, S0, L, t0)
    implicit_matrix(J, a, h, M)
    factorise(M, pivots)
    for i in range(SIZE):
        k[i] = F(0.0)
    last, size, whole = F(1e30), F(1e30), F(0.0)
    for _ in range(ITERATIONS):
RESIDUALS
        substitute(M, pivots, r)
        size, whole = F(0.0), abs(vx) + abs(vy) + abs(vz)
        for i in range(SIZE):
            k[i] += r[i]
            size += abs(r[i]) if i % 6 < 3 else h * abs(r[i])
            whole += abs(k[i]) if i % 6 < 3 else F(0.0)
        if size <= F(NEAR) * whole or not size < last:
            break
        last = size
    # Where rounding ended it, that is as near as can be; elsewhere there is no solution.
    if not size <= F(1e-3) * whole:
        k[0], k[3] = F(1e309), F(1e309)
"""
"""`together` finds the slopes k of all stages, six numbers each, by simplified Newton iterations;
G holds a further acceleration for each stage. Sizes are in m/s."""


SHIFTED = """

@inline
def shifted(x, y, z, vx, vy, vz, M, pivots, h, age, C, S, L, t):
    linearise(x, y, z, vx, vy, vz, F(0.0), F(0.0), F(0.0), M, age, C, S, L, t)
    for i in range(36):
        M[i] = -M[i]
    for i in range(6):
        M[7 * i] += F(INVERSE) / h
    factorise(M, pivots)
"""


SETTLE = """

@inline
def settle(px, py, pz, qx, qy, qz, gx, gy, gz, g, age, C, S, L, t):
    k, G = empty(6, F), empty(3, F)
    G[0], G[1], G[2] = gx, gy, gz
    together(px, py, pz, qx, qy, qz, G, k, g, age, C, S, L, t)
    return (
        px + g * k[0], py + g * k[1], pz + g * k[2],
        qx + g * k[3], qy + g * k[4], qz + g * k[5],
    )
"""
"""A stage that stands for itself, of a particle that flows carry as well."""


def settle_text(precision: str) -> str:
    """What `implicit.settle_text` gives, where flows make the equations six."""
    return _together_text([[1.0]], [0.0], precision) + SETTLE


def together_text(method: Implicit, precision: str) -> str:
    """`rate`, `linearise` and `together` for a method whose stages belong together."""
    needed = stages(method)
    rows = [[float(method.a[i][j]) for j in needed] for i in needed]
    return _together_text(rows, [float(method.c[i]) for i in needed], precision)


def _together_text(rows: list[list[float]], shares: list[float], precision: str) -> str:
    table = "".join(
        f"    a[{i}, {j}] = F({w!r})\n" for i, row in enumerate(rows) for j, w in enumerate(row)
    )
    residuals = ""
    for i, row in enumerate(rows):
        moved = [
            f"{name} + h * ({' + '.join(f'F({w!r}) * k[{6 * j + n}]' for j, w in enumerate(row))})"
            for n, name in enumerate(STATE)
        ]
        push = ", ".join(f"G[{3 * i + n}]" for n in range(3))
        when = f"age + F({shares[i]!r}) * h, C, S{i}, L, t{i}"
        residuals += f"        f = rate({', '.join(moved)}, {push}, {when})\n"
        residuals += "        for n, part in enumerate(f):\n"
        residuals += f"            r[{6 * i} + n] = part - k[{6 * i} + n]\n"
    text = TOGETHER.replace("TABLE\n", table).replace("RESIDUALS\n", residuals)
    text = text.replace("SCENE", _listed("S", len(rows))).replace("TIMES", _listed("t", len(rows)))
    text = text.replace("SIZE", str(6 * len(rows))).replace("STAGES", str(len(rows)))
    text = text.replace("ITERATIONS", str(ITERATIONS)).replace("NEAR", repr(epsilon(precision)))
    return _linearise_text(precision) + text


def together_lines(method: Implicit) -> tuple[str, list[str]]:
    """Source of a step of such a method, and its ends."""
    m = len(stages(method))
    lines = f"    k, G = empty({6 * m}, F), empty({3 * m}, F)\n"
    lines += f"    for i in range({3 * m}):\n        G[i] = F(0.0)\n"
    lines += f"    together({', '.join(STATE)}, G, k, h, age, C, {_listed('S', m)}, L, "
    lines += f"{_listed('t', m)})\n"
    weights = [method.b[i] for i in stages(method)]
    sums = [
        " + ".join(f"F({w!r}) * k[{6 * j + n}]" for j, w in enumerate(weights)) for n in range(6)
    ]
    return lines, [f"{name} + h * ({total})" for name, total in zip(STATE, sums, strict=True)]


DRIFT_TIMES = (0.0, 1 / 3, 2 / 3, 1.0)
"""Where a Rosenbrock method looks for the slope's own change in time, as shares of the step."""

DRIFT = (-11 / 2, 9.0, -9 / 2, 1.0)
"""Weights of those slopes in h dF/dt at the step's begin: exact for cubics, which keeps order 4."""


def rosenbrock_times(method: Rosenbrock) -> tuple[float, ...]:
    """Times at which a step needs the scene's values: of its stages, then of the change in time."""
    return (*method.c, *DRIFT_TIMES[1:])


def rosenbrock_lines(method: Rosenbrock) -> tuple[str, list[str]]:
    """Source of a step of a Rosenbrock method, and its ends: one matrix, no iteration."""
    start = ", ".join(STATE)

    def rated(state: str, share: float, place: int) -> str:
        when = f"age + F({share!r}) * h, C, S{place}, L, t{place}"
        return f"rate({state}, {QUIET}, {when})"

    lines = "    M, pivots, r = empty(36, F), empty(6, F), empty(6, F)\n"
    lines += f"    shifted({start}, M, pivots, h, age, C, S0, L, t0)\n"
    slopes = [f"f{n}" for n in STATE]
    lines += f"    {', '.join(slopes)} = {rated(start, 0.0, 0)}\n"
    for number, (share, weight) in enumerate(zip(DRIFT_TIMES, DRIFT, strict=True)):
        if number:
            later = ", ".join(f"g{n}" for n in STATE)
            lines += f"    {later} = {rated(start, share, method.stages + number - 1)}\n"
        part, total = ("f", "=") if not number else ("g", "+=")
        lines += "".join(f"    d{n} {total} F({weight!r}) * {part}{n}\n" for n in STATE)
    for i, row in enumerate(method.a):
        if i:
            state = ", ".join(_added(n, row, n) for n in STATE)
            lines += f"    {', '.join(slopes)} = {rated(state, float(method.c[i]), i)}\n"
        for m, n in enumerate(STATE):
            past = _added("F(0.0)", method.d[i], n)
            drift = f" + F({float(method.g[i])!r}) * d{n}" if method.g[i] else ""
            lines += f"    r[{m}] = f{n} + ({past}) / h{drift}\n"
        lines += "    substitute(M, pivots, r)\n"
        lines += "".join(f"    k{n}{i} = r[{m}]\n" for m, n in enumerate(STATE))
    return lines, [_added(n, method.b, n) for n in STATE]


def rosenbrock_text(method: Rosenbrock, precision: str) -> str:
    """`rate`, `linearise` and `shifted`, the factors of 1 / (gamma h) - dF/dY."""
    return _linearise_text(precision) + SHIFTED.replace("INVERSE", repr(1 / method.gamma))


def _linearise_text(precision: str) -> str:
    return LINEARISE.replace("SHIFT", repr(epsilon(precision) ** 0.4))


def _added(start: str, weights: tuple[float, ...], name: str) -> str:
    terms = [f"F({float(w)!r}) * k{name}{j}" for j, w in enumerate(weights) if w]
    return " + ".join([start, *terms])


def _listed(letter: str, count: int) -> str:
    return ", ".join(f"{letter}{i}" for i in range(count))
