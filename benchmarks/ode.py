"""Ordinary differential equations beside peers in the same run: python benchmarks/ode.py [--json].

Pleiades (28 components) to t = 3 at rtol = atol = 1e-9 with an eighth-order method, and Lorenz
systems to t = 20 at rtol = atol = 1e-6. SciPy gets both the NumPy function that a person would
write and the same compiled function as we; diffrax and numbalsoda are used where they are
installed. Each time is the best of several, without compilation.
"""

from __future__ import annotations

import importlib.util

import numpy as np
from _report import Report, arguments, best, machine
from numba import carray, cfunc, njit

from motes import ode

TOLERANCE = 1e-9
START = np.zeros(28)
START[:14] = 3, 3, -1, -3, 2, -2, 2, 3, -3, 2, 0, 0, -4, 4
START[[19, 20, 24, 25]] = 1.75, -1.5, -1.25, 1.0
MASS = np.arange(1.0, 8.0)


@njit(error_model="numpy")
def pleiades(t, s):
    out = np.empty(28)
    for i in range(14):
        out[i] = s[14 + i]
        out[14 + i] = 0.0
    for i in range(7):
        for j in range(i):
            dx, dy = s[j] - s[i], s[7 + j] - s[7 + i]
            square = dx * dx + dy * dy
            w = 1 / (square * np.sqrt(square))
            out[14 + i] += (j + 1) * w * dx
            out[21 + i] += (j + 1) * w * dy
            out[14 + j] -= (i + 1) * w * dx
            out[21 + j] -= (i + 1) * w * dy
    return out


def pleiades_numpy(t, s):
    p = s[:14].reshape(2, 7)
    d = p[:, None, :] - p[:, :, None]
    r3 = ((d**2).sum(0) + np.eye(7)) ** 1.5
    return np.concatenate([s[14:], (MASS * d / r3).sum(-1).reshape(-1)])


@njit
def lorenz(t, y, rho):
    return 10 * (y[1] - y[0]), y[0] * (rho - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]


@njit
def evaluate(s, count):
    """`count` evaluations, each on a state of its own that all of the last one shaped."""
    work = s.copy()
    for _ in range(count):
        slope = pleiades(0.0, work)
        for i in range(28):
            work[i] = s[i] + 1e-9 * slope[i]
    return work


def one_system(report: Report, quick: bool) -> None:
    from scipy.integrate import solve_ivp

    repeats = 5 if quick else 30
    options = {"method": "dop853", "rtol": TOLERANCE, "atol": TOLERANCE}
    ours = ode.solve(pleiades, START, (0, 3), **options)
    seconds = best(lambda: ode.solve(pleiades, START, (0, 3), **options), repeats)
    one = best(lambda: evaluate(START, 10_000), repeats) / 10_000
    report.figures["Pleiades, motes"] = (seconds * 1e3, "ms")
    report.figures["Pleiades, evaluations alone"] = (ours.evaluations * one * 1e3, "ms")
    report.ratio("Pleiades, motes", "Pleiades, evaluations alone")
    scipy = {"method": "DOP853", "rtol": TOLERANCE, "atol": TOLERANCE}
    for name, f in (("NumPy", pleiades_numpy), ("compiled", pleiades)):
        seconds = best(lambda f=f: solve_ivp(f, (0, 3), START, **scipy), 3)
        report.figures[f"Pleiades, SciPy, {name} f"] = (seconds * 1e3, "ms")
        report.ratio(f"Pleiades, SciPy, {name} f", "Pleiades, motes")
    plain = best(lambda: ode.solve(pleiades_numpy, START, (0, 3), **options), 3)
    report.figures["Pleiades, motes, NumPy f"] = (plain * 1e3, "ms")
    report.ratio("Pleiades, SciPy, NumPy f", "Pleiades, motes, NumPy f")
    theirs = solve_ivp(pleiades, (0, 3), START, **scipy).nfev
    report.figures["evaluations, motes"] = (ours.evaluations, "")
    report.figures["evaluations, SciPy"] = (theirs, "")
    report.ratio("evaluations, motes", "evaluations, SciPy")
    report.figures["evaluations at equal error, motes / SciPy"] = (_at_equal_error(), "")
    if importlib.util.find_spec("diffrax"):
        from _peer_diffrax import pleiades as peer

        report.figures["Pleiades, diffrax"] = (peer(START, TOLERANCE) * 1e3, "ms")
        report.ratio("Pleiades, diffrax", "Pleiades, motes")


def _at_equal_error() -> float:
    """Largest ratio of evaluations, over errors that both reach between rtol 1e-5 and 1e-11."""
    from scipy.integrate import solve_ivp

    exact = ode.solve(pleiades, START, (0, 3), method="verner9", rtol=1e-14, atol=1e-15).y[-1]
    fits, errors = [], []
    for solve in (
        lambda tol: ode.solve(pleiades, START, (0, 3), method="dop853", rtol=tol, atol=tol),
        lambda tol: solve_ivp(pleiades, (0, 3), START, method="DOP853", rtol=tol, atol=tol),
    ):
        found = [solve(10.0**-k) for k in np.arange(5, 11.01, 0.5)]
        ends = [r.y[-1] if hasattr(r, "evaluations") else r.y[:, -1] for r in found]
        work = [r.evaluations if hasattr(r, "evaluations") else r.nfev for r in found]
        errors.append(np.log([np.abs(end - exact).max() for end in ends]))
        fits.append(np.polyfit(errors[-1], np.log(work), 2))
    low, high = max(e.min() for e in errors), min(e.max() for e in errors)
    at = np.linspace(low, high, 20)
    return float(np.exp(np.polyval(fits[0], at) - np.polyval(fits[1], at)).max())


def krylov(report: Report) -> None:
    """One linear solve of a backward Euler step of heat on 400 points: ours, and SciPy's GMRES."""
    from scipy.sparse.linalg import LinearOperator, gmres

    n, h = 400, 1e-3

    def heat(t, y):
        wide = np.concatenate([[0.0], y, [0.0]])
        return n * n * (wide[2:] - 2 * y + wide[:-2])

    y = np.sin(np.pi * np.arange(1, n + 1) / (n + 1)) + 0.1 * np.arange(n) / n
    options = {"method": "backward_euler", "step": h, "newton": ode.Newton(solver="krylov")}
    report.figures["Krylov step, motes"] = (
        best(lambda: ode.solve(heat, y, (0, h), **options), 5) * 1e3,
        "ms",
    )

    def scipy() -> None:
        k, start = heat(0.0, y), heat(0.0, y)
        size = np.sqrt(np.finfo(float).eps * (1 + np.linalg.norm(y)))

        def apply(v):
            e = size / max(np.linalg.norm(v), 1e-300)
            return v - h * (heat(0.0, y + e * v) - start) / e

        operator = LinearOperator((n, n), apply)
        for _ in range(12):
            change = gmres(operator, heat(h, y + h * k) - k, rtol=1e-6, restart=60, maxiter=1)[0]
            k = k + change
            if h * np.abs(change).max() <= 1e-13:
                break

    report.figures["Krylov step, SciPy's GMRES"] = (best(scipy, 5) * 1e3, "ms")
    report.ratio("Krylov step, SciPy's GMRES", "Krylov step, motes")


def many_systems(report: Report, quick: bool) -> None:
    from scipy.integrate import solve_ivp

    count = 2_000 if quick else 100_000
    few = min(count, 2_000)
    starts = 1 + 0.1 * np.random.default_rng(0).standard_normal((count, 3))
    options = {"args": (28.0,), "method": "tsit5", "rtol": 1e-6, "atol": 1e-6}
    unit = "us a system"
    seconds = best(lambda: ode.solve_many(lorenz, starts, (0, 20), **options), 1 if quick else 2)
    report.figures["Lorenz, motes"] = (seconds / count * 1e6, unit)
    scipy = {"method": "RK45", "rtol": 1e-6, "atol": 1e-6, "args": (28.0,)}
    seconds = best(lambda: [solve_ivp(lorenz, (0, 20), y, **scipy) for y in starts[:5]], 1)
    report.figures["Lorenz, SciPy"] = (seconds / 5 * 1e6, unit)
    if importlib.util.find_spec("diffrax"):
        from _peer_diffrax import lorenz as peer

        report.figures["Lorenz, diffrax"] = (peer(starts[:few], 20.0, 1e-6) / few * 1e6, unit)
    if importlib.util.find_spec("numbalsoda"):
        report.figures["Lorenz, numbalsoda"] = (_numbalsoda(starts[:few]) / few * 1e6, unit)
    for peer_name in ("SciPy", "diffrax", "numbalsoda"):
        report.ratio(f"Lorenz, {peer_name}", "Lorenz, motes")


def _numbalsoda(starts: np.ndarray) -> float:
    """Seconds for its DOP853 on these systems, on one thread."""
    from numbalsoda import dop853, lsoda_sig

    @cfunc(lsoda_sig)
    def rhs(t, y, dy, p):
        state = carray(y, (3,))
        dy[0] = 10 * (state[1] - state[0])
        dy[1] = state[0] * (28.0 - state[2]) - state[1]
        dy[2] = state[0] * state[1] - 8 / 3 * state[2]

    pointer, times = rhs.address, np.array([0.0, 20.0])

    @njit
    def run(starts):
        for i in range(len(starts)):
            dop853(pointer, starts[i], times, rtol=1e-6, atol=1e-6)

    return best(lambda: run(starts), 1)


def main() -> None:
    given = arguments(__doc__).parse_args()
    report = Report(
        "Ordinary differential equations",
        machine=machine(("scipy", "diffrax", "jax", "numbalsoda")),
    )
    one_system(report, given.quick)
    krylov(report)
    many_systems(report, given.quick)
    for peer in ("diffrax", "numbalsoda"):
        if importlib.util.find_spec(peer) is None:
            report.notes.append(f"{peer} is not installed: it was left out")
    report.print(given.json)


if __name__ == "__main__":
    main()
