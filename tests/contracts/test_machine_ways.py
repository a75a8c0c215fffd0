"""Ways through kernels: choices, loops, what a name stands for."""

from __future__ import annotations

import numpy as np
from both_ways import WITH_COMPILER, same

pytestmark = WITH_COMPILER


def test_choices_and_conditions():
    def choose(x, n):
        a = 1.0 if x > 0.5 else 2 * x
        b = (x, a) if (n > 3 and x > 0.1) or n == 0 else (a, x)
        if x > 0.9:
            kind = 3
        elif not x > 0.2:
            return a, b, 0, x < 0.1 < a
        else:
            kind = n if n in (1, 5, 7) else -1
        return a, b, kind, 0.3 < x <= 0.6

    for x in (0.05, 0.15, 0.3, 0.55, 0.95):
        for n in (0, 1, 4, 5):
            same(choose, x, n)


def test_a_name_may_be_an_integer_first_and_real_later():
    def total(x):
        s = 0
        for i in range(x.size):
            s += x[i]
        return s

    same(total, np.linspace(0.1, 2, 11))
    same(total, np.arange(7))


def test_loops_with_breaks_and_early_returns():
    def search(x, wanted, limit):
        found = -1
        for i in range(x.size):
            if x[i] < 0:
                continue
            if x[i] == wanted:
                found = i
                break
            if x[i] > limit:
                return found, i
        k, n = 1, 0
        while k < 1000:
            k *= 2
            n += 1
            if k > limit:
                break
        return found, n

    x = np.array([3.0, -1.0, 8.0, 5.0, 2.0])
    for wanted in (8.0, 2.0, 9.0):
        for limit in (4.0, 7.0, 100.0):
            same(search, x, wanted, limit)


def test_loops_within_loops_and_what_they_leave_behind():
    def spiral(n):
        a, b, last = 1, 1, 0
        for i in range(n):
            for j in range(i, 2 * n, 3):
                if (i * j) % 5 == 4:
                    break
                a, b = b, (a + 3 * b + j) % 1009
                last = j
        for k in range(5, 0, -2):
            a += k
        return a, b, last, k

    for n in (1, 4, 9):
        same(spiral, n)


def test_a_loop_over_a_tuple_is_written_out():
    def sums(p, out):
        for k, (a, b) in enumerate(p):
            if a > b:
                continue
            out[k] = a + b
        for row in range(3):
            out[row] += p[row][0]

    same(sums, ((1.0, 2), (3.0, 1), (2.0, 5)), np.zeros(3))


def test_a_condition_that_is_known_hides_code_that_would_not_fit():
    present, absent = True, None

    def pick(x):
        if absent is not None:
            return x.nothing
        if not present:
            return x[0]
        return x if present else x.nothing

    assert same(pick, 2.5) == 2.5


def test_the_rest_of_a_condition_is_not_looked_at_in_vain():
    """An index that `and` protects is never used; 4096 places away there may be no memory."""

    def guarded(x, i):
        return (i < x.size and x[i] > 0.5) or i == 1 << 40

    x = np.array([0.2, 0.9])
    for i in (0, 1, 2, 1 << 40):
        same(guarded, x, i)
