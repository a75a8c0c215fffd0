"""Many small systems at once: thirty-two side by side, each with its own time and step.

Numbers of one component lie in one row for all lanes, so that a processor works on eight of them
with one instruction. A lane whose system is done takes the next one; nothing that a lane does
depends on its neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from motes.generated import executed
from motes.jit import EXACT, jit
from motes.ode.arithmetic import Array, Kernel
from motes.ode.march import LAST, NOW, SAFETY
from motes.tableau import Explicit

LANES = 32
"""Systems side by side: latencies of some hide behind the others."""

SHORTEST = 1e-300
"""A step that is no longer leads nowhere, at time 0 either."""


class Batch(NamedTuple):
    """States and steps of many systems, one column each; a march goes on from what it finds."""

    y: Array
    """States, (n, m)."""
    step: Array
    """Steps to go on with, (m,); 0: find one."""
    before: Array
    """Error of each system's last step, (m,)."""
    work: Any
    """Evaluations, steps, rejected steps, and whether it failed, (4, m)."""


WHOLE = 4503599627370496.0  # 2^52: above it, the last bit of a double counts 1.


@jit(inline=True)
def rough_power(x: float, p: float) -> float:
    """x to the power p within 2 %, for x > 0, from the bits of x: enough to choose a step.

    Integers become doubles and back by their bits beside 2^52: processors have no instruction for
    several at once.
    """
    bits = np.float64(x).view(np.int64)
    exponent = np.int64((bits >> 52) | 0x4330000000000000).view(np.float64) - WHOLE - 1023.0
    rest = np.int64((bits & 0xFFFFFFFFFFFFF) | 0x3FF0000000000000).view(np.float64) - 1.0
    y = p * (exponent + rest * (1.3333 - 0.3333 * rest))
    k = np.floor(y)
    f = y - k
    scale = np.int64(np.float64(k + WHOLE + 1023.0).view(np.int64) << 52).view(np.float64)
    return float(scale * (1.0 + f * (0.6565 + 0.3435 * f)))


def march(f: Any, size: int, arguments: int, table: Explicit) -> Kernel:
    """A kernel that takes the systems `low` to `high` of a batch from t0 to t1.

    f gets its state as a tuple of `size` numbers, and `arguments` further numbers. The kernel gets
    the number of lanes as an argument: short loops of a known length would be written out, not
    become SIMD.
    """
    rows = table.closed
    last = len(rows) - 1
    combine = _combination(rows)
    low = table.b_low
    adaptive = low is not None
    weights = np.subtract(table.b, low).tolist() if low is not None else []
    estimate = _combination([weights])
    slope = _slope(f, size, arguments)
    times = np.array((*table.c, 1.0)[: last + 1], float)
    power = 1.0 / table.order

    @jit
    def run(t0, t1, batch, parameters, fixed, rtol, atol, limit, lower, upper, width):  # type: ignore[no-untyped-def]
        y = np.zeros((size, LANES))
        end = np.zeros((size, LANES))
        error = np.zeros((size, LANES))
        zero = np.zeros((size, LANES))
        k = np.zeros((last + 1, size, LANES))
        a = np.zeros((arguments, LANES))
        t = np.zeros(LANES)
        h = np.zeros(LANES)
        now = np.zeros(LANES)
        want = np.zeros(LANES)
        norm = np.zeros(LANES)
        before = np.zeros(LANES)
        taken = np.zeros(LANES)
        refused = np.zeros(LANES)
        system = np.zeros(LANES, np.int64)
        new = np.zeros(LANES, np.bool_)
        done = np.zeros(LANES, np.bool_)
        sign = 1.0 if t1 >= t0 else -1.0
        following = lower
        open_ones = upper - lower
        idle = True
        for lane in range(width):
            t[lane], before[lane], system[lane] = t1, 1.0, -1
        while open_ones > 0:
            if idle and following < upper:
                for lane in range(width):
                    if system[lane] < 0 and following < upper:
                        system[lane] = following
                        new[lane] = True
                        for c in range(size):
                            y[c, lane] = batch.y[c, following]
                        for c in range(arguments):
                            a[c, lane] = parameters[c, following % parameters.shape[1]]
                        t[lane] = t0
                        want[lane] = batch.step[following]
                        before[lane] = batch.before[following]
                        taken[lane] = 0.0
                        refused[lane] = 0.0
                        following += 1
                slope(t, y, a, end, width)
                for lane in range(width):
                    if new[lane]:
                        for c in range(size):
                            k[0, c, lane] = end[c, lane]
                    if new[lane] and want[lane] == 0.0:
                        state = 0.0
                        speed = 0.0
                        for c in range(size):
                            scale = atol[c] + rtol * abs(y[c, lane])
                            state += (y[c, lane] / scale) ** 2
                            speed += (k[0, c, lane] / scale) ** 2
                        trial = 0.01 * math.sqrt(state / speed) if speed > 0.0 else 0.0
                        want[lane] = min(abs(t1 - t0), max(1e-6 * abs(t1 - t0), trial))
                    new[lane] = False
            idle = False
            for lane in range(width):
                step = abs(t1 - t[lane])
                now[lane] = sign * (step if 1.01 * want[lane] >= step else want[lane])
            for i in range(1, last + 1):
                combine(i, y, k, now, end, width)
                for lane in range(width):
                    h[lane] = t[lane] + times[i] * now[lane]
                slope(h, end, a, k[i], width)
            if adaptive and not fixed:
                estimate(0, zero, k, now, error, width)
                for lane in range(width):
                    norm[lane] = 0.0
                for c in range(size):
                    for lane in range(width):
                        scale = atol[c] + rtol * max(abs(y[c, lane]), abs(end[c, lane]))
                        norm[lane] += (error[c, lane] / scale) ** 2
                for lane in range(width):
                    e = math.sqrt(norm[lane] / size)
                    good = e <= 1.0
                    e = e if e < 1e10 else 1e10
                    e = e if e > 1e-10 else 1e-10
                    kept = rough_power(before[lane], LAST * power)
                    grow = SAFETY * rough_power(e, -NOW * power) * kept
                    shrink = 0.9 * rough_power(e, -power)
                    grow = min(10.0, max(0.2, grow))
                    shrink = min(0.9, max(0.1, shrink))
                    # A step that was only shortened to reach the end says little about the next.
                    base = want[lane] if good and grow > 1.0 else abs(now[lane])
                    want[lane] = base * (grow if good else shrink)
                    before[lane] = max(e, 1e-4) if good else before[lane]
                    norm[lane] = 1.0 if good else 0.0
            else:
                for lane in range(width):
                    norm[lane] = 1.0
            for c in range(size):
                for lane in range(width):
                    good = norm[lane] > 0.0
                    y[c, lane] = end[c, lane] if good else y[c, lane]
                    k[0, c, lane] = k[last, c, lane] if good else k[0, c, lane]
            for lane in range(width):
                good = norm[lane] > 0.0
                reach = t[lane] + now[lane]
                # The time of a fixed step is n h, never a sum.
                reach = t0 + sign * (taken[lane] + 1.0) * want[lane] if fixed else reach
                reach = t1 if now[lane] == t1 - t[lane] else reach
                taken[lane] += 1.0 if good else 0.0
                refused[lane] += 0.0 if good else 1.0
                t[lane] = reach if good else t[lane]
                stuck = not abs(now[lane]) >= max(4e-16 * abs(t[lane]), SHORTEST)
                stuck = stuck or taken[lane] + refused[lane] >= limit
                done[lane] = t[lane] == t1 or stuck
                idle = idle or (done[lane] and system[lane] >= 0)
            if not idle:
                continue
            for lane in range(width):
                place = system[lane]
                if place < 0 or not done[lane]:
                    continue
                failed = t[lane] != t1
                for c in range(size):
                    batch.y[c, place] = y[c, lane]
                    failed = failed or not abs(y[c, lane]) < math.inf
                batch.step[place] = want[lane]
                batch.before[place] = before[lane]
                batch.work[0, place] += int(1 + last * (taken[lane] + refused[lane]))
                batch.work[1, place] += int(taken[lane])
                batch.work[2, place] += int(refused[lane])
                batch.work[3, place] |= int(failed)
                system[lane] = -1
                t[lane] = t1
                open_ones -= 1

    return run


def _slope(f: Any, size: int, arguments: int) -> Kernel:
    """slope(t, y, a, out): f in every lane."""
    state = "".join(f"y[{c}, lane], " for c in range(size))
    further = "".join(f", a[{c}, lane]" for c in range(arguments))
    lines = [
        "def slope(t, y, a, out, width):",
        "    for lane in range(width):",
        f"        value = f(t[lane], ({state}){further})",
        f"        if len(value) == {size}:",
        *(f"            out[{c}, lane] = value[{c}]" for c in range(size)),
        "        else:",  # Of another shape than the state: no solution.
        *(f"            out[{c}, lane] = math.nan" for c in range(size)),
    ]
    return _made(lines, "slope", {"f": jit(f.py_func, flags=EXACT, inline=True), "math": math})


def _combination(rows: Sequence[Sequence[float]]) -> Kernel:
    """combine(row, y, k, h, out): out = y + h sum_j rows[row][j] k[j], h differing by lane."""
    lines = ["def combine(row, y, k, h, out, width):", "    pass"]
    for number, row in enumerate(rows):
        terms = [f"{float(weight)!r} * k[{j}, c, lane]" for j, weight in enumerate(row) if weight]
        if terms:
            lines += [
                f"    if row == {number}:",
                "        for c in range(y.shape[0]):",
                "            for lane in range(width):",
                f"                out[c, lane] = y[c, lane] + h[lane] * ({' + '.join(terms)})",
            ]
    return _made(lines, "combine", {})


def _made(lines: list[str], name: str, names: dict[str, Any]) -> Kernel:
    """A kernel from generated source: numbers of a table and of lanes stand in the machine code."""
    names = {"__name__": __name__, **names}
    function: Callable[..., Any] = executed("\n".join(lines), names)[name]
    return jit(function, inline=True)
