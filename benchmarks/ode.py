"""Ordinary differential equations beside peers in the same run: python benchmarks/ode.py [--json].

Pleiades (28 components) to t = 3 at rtol = atol = 1e-9 with an eighth-order method, evaluations at
equal error on five problems, Krylov spaces, and Lorenz systems to t = 20 at rtol = atol = 1e-6.
SciPy gets both the NumPy function that a person would write and the same compiled function as we;
diffrax and numbalsoda are used where they are installed. Each time is the best of several, without
compilation; --only takes some of the parts.
"""

from __future__ import annotations

import importlib.util

import numpy as np
from _report import Report, arguments, best, best_in_turn, machine
from numba import carray, cfunc, njit, prange

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

    repeats = 20 if quick else 200
    options = {"method": "dop853", "rtol": TOLERANCE, "atol": TOLERANCE}
    ours = ode.solve(pleiades, START, (0, 3), **options)
    count = ours.evaluations
    # In turn, so that both see the same moods of the machine.
    seconds, alone = best_in_turn(
        lambda: ode.solve(pleiades, START, (0, 3), **options),
        lambda: evaluate(START, count),
        repeats=repeats,
    )
    report.figures["Pleiades, motes"] = (seconds * 1e3, "ms")
    report.figures["Pleiades, evaluations alone"] = (alone * 1e3, "ms")
    report.ratio("Pleiades, motes", "Pleiades, evaluations alone")
    scipy = {"method": "DOP853", "rtol": TOLERANCE, "atol": TOLERANCE}
    seconds = best(lambda: solve_ivp(pleiades, (0, 3), START, **scipy), repeats // 4)
    report.figures["Pleiades, SciPy, compiled f"] = (seconds * 1e3, "ms")
    theirs, plain, alone = best_in_turn(
        lambda: solve_ivp(pleiades_numpy, (0, 3), START, **scipy),
        lambda: ode.solve(pleiades_numpy, START, (0, 3), **options),
        lambda: [pleiades_numpy(0.0, START) for _ in range(1000)],
        repeats=repeats // 10,
    )
    report.figures["Pleiades, SciPy, NumPy f"] = (theirs * 1e3, "ms")
    report.figures["Pleiades, motes, NumPy f"] = (plain * 1e3, "ms")
    for name in ("NumPy", "compiled"):
        report.ratio(f"Pleiades, SciPy, {name} f", "Pleiades, motes")
    # What each solver costs beyond the evaluations that it asks for.
    calls = solve_ivp(pleiades_numpy, (0, 3), START, **scipy).nfev
    report.figures["around a NumPy f, SciPy"] = ((theirs - calls * alone / 1e3) * 1e3, "ms")
    calls = ode.solve(pleiades_numpy, START, (0, 3), **options).evaluations
    report.figures["around a NumPy f, motes"] = ((plain - calls * alone / 1e3) * 1e3, "ms")
    report.ratio("around a NumPy f, motes", "around a NumPy f, SciPy")
    report.ratio("Pleiades, motes, NumPy f", "Pleiades, SciPy, NumPy f")


def diffrax(report: Report, quick: bool) -> None:
    if importlib.util.find_spec("diffrax") is None:
        report.notes.append("diffrax is not installed: it was left out")
        return
    from _peer_diffrax import pleiades as peer

    options = {"method": "dop853", "rtol": TOLERANCE, "atol": TOLERANCE}
    report.figures["Pleiades, diffrax"] = (peer(START, TOLERANCE) * 1e3, "ms")
    seconds = best(lambda: ode.solve(pleiades, START, (0, 3), **options), 200)
    report.figures["Pleiades, motes, again"] = (seconds * 1e3, "ms")
    report.ratio("Pleiades, diffrax", "Pleiades, motes, again")


@njit
def arenstorf(t, y):
    """A spacecraft between earth and moon: Hairer, Norsett and Wanner I, section II.0."""
    m = 0.012277471
    n = 1 - m
    d = ((y[0] + m) ** 2 + y[1] ** 2) ** 1.5
    e = ((y[0] - n) ** 2 + y[1] ** 2) ** 1.5
    ax = y[0] + 2 * y[3] - n * (y[0] + m) / d - m * (y[0] - n) / e
    ay = y[1] - 2 * y[2] - n * y[1] / d - m * y[1] / e
    return y[2], y[3], ax, ay


@njit
def kepler(t, y):
    r3 = (y[0] * y[0] + y[1] * y[1]) ** 1.5
    return y[2], y[3], -y[0] / r3, -y[1] / r3


@njit
def butterfly(t, y):
    return 10 * (y[1] - y[0]), y[0] * (28.0 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]


@njit
def van_der_pol(t, y):
    return y[1], 5 * (1 - y[0] * y[0]) * y[1] - y[0]


PROBLEMS = {
    "Pleiades": (pleiades, START, 3.0),
    "Arenstorf": (arenstorf, [0.994, 0.0, 0.0, -2.001585106379082522405], 17.06521656015796255889),
    "Kepler, e = 0.9": (kepler, [0.1, 0.0, 0.0, 19**0.5], 6 * np.pi),
    "Lorenz": (butterfly, [1.0, 1.0, 1.0], 10.0),
    "van der Pol": (van_der_pol, [2.0, 0.0], 30.0),
}


def evaluations(report: Report, quick: bool) -> None:
    """Largest ratio of evaluations to SciPy's DOP853 over the errors that both reach.

    One solve's error is half luck: curves are fitted through tolerances from 1e-4 to 1e-12.
    """
    from scipy.integrate import solve_ivp

    tolerances = 10.0 ** -np.arange(4, 12.01, 0.5 if quick else 0.1)
    for name, (f, start, end) in PROBLEMS.items():
        y = np.array(start)
        exact = ode.solve(f, y, (0, end), method="verner9", rtol=1e-14, atol=1e-15).y[-1]
        work, error = np.empty((2, 2, len(tolerances)))
        for k, tol in enumerate(tolerances):
            r = ode.solve(f, y, (0, end), method="dop853", rtol=tol, atol=tol)
            s = solve_ivp(f, (0, end), y, method="DOP853", rtol=tol, atol=tol)
            work[:, k] = r.evaluations, s.nfev
            error[:, k] = np.abs(r.y[-1] - exact).max(), np.abs(s.y[:, -1] - exact).max()
        work, error = np.log(work), np.log(error)
        ours, theirs = (np.polyfit(x, y, 2) for x, y in zip(error, work, strict=True))
        low, high = np.percentile(error, 3, axis=1).max(), np.percentile(error, 97, axis=1).min()
        at = np.linspace(low, high, 20)
        ratio = np.exp(np.polyval(ours, at) - np.polyval(theirs, at))
        report.figures[f"evaluations / SciPy's, {name}, most"] = (ratio.max(), "")
        report.figures[f"evaluations / SciPy's, {name}, least"] = (ratio.min(), "")


def krylov(report: Report, quick: bool) -> None:
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
    for peer in ("SciPy", "diffrax", "numbalsoda"):
        report.ratio(f"Lorenz, {peer}", "Lorenz, motes")
        if f"Lorenz, {peer}" not in report.figures:
            report.notes.append(f"{peer} is not installed: it was left out")


def _numbalsoda(starts: np.ndarray) -> float:
    """Seconds for its DOP853 on these systems, on all processors."""
    from numbalsoda import dop853, lsoda_sig

    @cfunc(lsoda_sig)
    def rhs(t, y, dy, p):
        state = carray(y, (3,))
        dy[0] = 10 * (state[1] - state[0])
        dy[1] = state[0] * (28.0 - state[2]) - state[1]
        dy[2] = state[0] * state[1] - 8 / 3 * state[2]

    pointer, times = rhs.address, np.array([0.0, 20.0])

    @njit(parallel=True)
    def run(starts):
        for i in prange(len(starts)):
            dop853(pointer, starts[i], times, rtol=1e-6, atol=1e-6)

    return best(lambda: run(starts), 1)


PARTS = {
    "pleiades": one_system,
    "diffrax": diffrax,
    "evaluations": evaluations,
    "krylov": krylov,
    "lorenz": many_systems,
}


def main() -> None:
    parser = arguments(__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="some parts")
    given = parser.parse_args()
    report = Report(
        "Ordinary differential equations",
        machine=machine(("scipy", "diffrax", "jax", "numbalsoda")),
    )
    for part in given.only:
        PARTS[part](report, given.quick)
    report.print(given.json)


if __name__ == "__main__":
    main()
