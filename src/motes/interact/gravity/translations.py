"""The operations on expansions: particles to moments, moments to moments, to local terms, to field.

Lengths are in units of a cell's radius h and, between two cells, of their distance R, so that no
power under- or overflows in single precision: moments are kept as M_b / h^|b| and local terms as
L_a h^|a|. Up to LANES particles, children or source cells go through an operation together.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motes.interact.gravity.expansions import GROUP, Tables
from motes.interact.gravity.lanes import LANES, fma, load, spread, store
from motes.jit import jit


class Bench(NamedTuple):
    """Working memory of the operations; rows are LANES wide."""

    place: NDArray[Any]
    """(5, lanes) coordinates and a factor, the input of every operation, and one free row."""
    ratio: NDArray[Any]
    """(lanes,) radius of each child or source cell."""
    moments: NDArray[Any]
    """(basis, lanes) the input moments."""
    powers: NDArray[Any]
    """(order + 1, lanes)"""
    monomials: NDArray[Any]
    """(all, lanes)"""
    slopes: NDArray[Any]
    """(slopes + 1, lanes), the last one zero."""
    sums: NDArray[Any]
    """(all, lanes)"""
    whole: NDArray[Any]
    """(all,) one expansion with all of its terms."""


def bench(table: Tables, real: type) -> Bench:
    """Working memory for one thread."""
    order = int(table.degree[-1])
    whole, basis = len(table.monomial), len(table.degree)

    def rows(count: int) -> NDArray[Any]:
        return np.zeros((count, LANES), real)

    return Bench(
        place=rows(5),
        ratio=np.ones(LANES, real),
        moments=rows(basis),
        powers=rows(order + 1),
        monomials=rows(whole),
        slopes=rows(len(table.slope_first)),
        sums=rows(max(whole, basis)),
        whole=np.zeros(whole, real),
    )


@jit
def raise_monomials(table: Tables, bench: Bench) -> None:
    """All y^a / a! times the factor in place[3], of coordinates in place[:3]."""
    store(bench.monomials, 0, load(bench.place, 3))
    nothing = spread(table.factor[0] - table.factor[0])
    for row in range(1, table.monomial.shape[0]):
        axis, parent = table.monomial[row, 0], table.monomial[row, 1]
        step = fma(load(bench.place, axis), spread(table.factor[row]), nothing)
        store(bench.monomials, row, fma(step, load(bench.monomials, parent), nothing))


@jit
def fold(table: Tables, whole: Any, moments: Any) -> None:
    """Express moments of all terms by those of the basis."""
    for step in range(table.trace.shape[0]):
        value = whole[table.trace[step, 0]]
        whole[table.trace[step, 1]] -= value
        whole[table.trace[step, 2]] -= value
    for row in range(table.kept.size):
        moments[row] = whole[table.kept[row]]


@jit
def unfold(table: Tables, local: Any, whole: Any) -> None:
    """All local terms from those of the basis."""
    for row in range(table.kept.size):
        whole[table.kept[row]] = local[row]
    for back in range(table.trace.shape[0]):
        step = table.trace.shape[0] - 1 - back
        whole[table.trace[step, 0]] = -(whole[table.trace[step, 1]] + whole[table.trace[step, 2]])


@jit
def add_lanes(rows: Any, count: Any, total: Any) -> None:
    """Sum each of the first `count` rows over its lanes."""
    for row in range(count):
        total[row] = rows[row].sum()


@jit
def particles_to_moments(
    table: Tables, bench: Bench, particles: Any, count: Any, scale: Any, moments: Any
) -> None:
    """Moments of the first `count` particles: rows x, y, z from the cell's center, and m.

    `scale` is one over the cell's radius.
    """
    bench.sums[:] = 0
    for first in range(0, count, LANES):
        for lane in range(LANES):
            i = min(first + lane, count - 1)
            for axis in range(3):
                bench.place[axis, lane] = -particles[axis, i] * scale
            bench.place[3, lane] = particles[3, i] if first + lane < count else 0
        raise_monomials(table, bench)
        one = spread(table.factor[0])
        for row in range(bench.whole.size):
            store(bench.sums, row, fma(load(bench.monomials, row), one, load(bench.sums, row)))
    add_lanes(bench.sums, bench.whole.size, bench.whole)
    fold(table, bench.whole, moments)


@jit
def scale_moments(table: Tables, bench: Bench) -> None:
    """Multiply the moments of degree n by the n-th power of `ratio`, times place[3]."""
    for lane in range(LANES):
        bench.powers[0, lane] = bench.place[3, lane]
    for n in range(1, bench.powers.shape[0]):
        for lane in range(LANES):
            bench.powers[n, lane] = bench.powers[n - 1, lane] * bench.ratio[lane]
    nothing = spread(table.factor[0] - table.factor[0])
    for row in range(table.kept.size):
        power = load(bench.powers, table.degree[row])
        store(bench.moments, row, fma(load(bench.moments, row), power, nothing))


@jit
def moments_to_moments(table: Tables, bench: Bench, moments: Any) -> None:
    """A parent's moments from its children's.

    place[:3] is the parent's center from the child's, in the parent's radius; `ratio` is the
    child's radius in the same unit; place[3] is 1, and 0 in unused lanes.
    """
    scale_moments(table, bench)
    raise_monomials(table, bench)
    nothing = spread(table.factor[0] - table.factor[0])
    for row in range(bench.whole.size):
        total = nothing
        for k in range(table.up_first[row], table.up_first[row + 1]):
            moment = load(bench.moments, table.up[k, 0])
            total = fma(moment, load(bench.monomials, table.up[k, 1]), total)
        store(bench.sums, row, total)
    add_lanes(bench.sums, bench.whole.size, bench.whole)
    fold(table, bench.whole, moments)


@jit
def differentiate(table: Tables, bench: Bench) -> None:
    """All derivatives of the potential at the unit places in place[:3], with place[3] = 1."""
    nothing = spread(table.factor[0] - table.factor[0])
    store(bench.slopes, 0, load(bench.place, 3))
    for row in range(1, table.slope_first.size - 1):
        total = nothing
        for k in range(table.slope_first[row], table.slope_first[row + 1]):
            slope = load(bench.slopes, table.slope_terms[k, 0])
            factor = fma(
                load(bench.place, table.slope_terms[k, 1]), spread(table.slope_factors[k]), nothing
            )
            total = fma(slope, factor, total)
        store(bench.slopes, row, total)


@jit
def moments_to_local(table: Tables, bench: Bench, h: Any, e2: Any, local: Any) -> None:
    """Add the local terms, in a cell of radius `h`, of up to LANES source cells.

    place[:3] is the target's center from the source's; place[3] is 1, and 0 in unused lanes; e2 is
    the squared softening. `local` is (basis, lanes): the sum over lanes is left to the end.
    """
    for lane in range(LANES):
        x, y, z = bench.place[0, lane], bench.place[1, lane], bench.place[2, lane]
        inverse = table.factor[0] / np.sqrt(x * x + y * y + z * z + e2)
        bench.place[0, lane] = x * inverse
        bench.place[1, lane] = y * inverse
        bench.place[2, lane] = z * inverse
        bench.place[3, lane] *= inverse
        bench.ratio[lane] *= inverse
        bench.place[4, lane] = inverse
    scale_moments(table, bench)
    one = table.factor[0]
    for lane in range(LANES):
        bench.place[3, lane] = one
        bench.powers[0, lane] = one
        bench.ratio[lane] = h * bench.place[4, lane]
    for n in range(1, bench.powers.shape[0]):
        for lane in range(LANES):
            bench.powers[n, lane] = bench.powers[n - 1, lane] * bench.ratio[lane]
    differentiate(table, bench)
    nothing = spread(one - one)
    k = 0
    for group in range(table.meets.size):
        a0 = a1 = a2 = a3 = nothing
        for moment_row in range(table.meets[group]):
            moment = load(bench.moments, moment_row)
            a0 = fma(moment, load(bench.slopes, table.meeting[k, 0]), a0)
            a1 = fma(moment, load(bench.slopes, table.meeting[k, 1]), a1)
            a2 = fma(moment, load(bench.slopes, table.meeting[k, 2]), a2)
            a3 = fma(moment, load(bench.slopes, table.meeting[k, 3]), a3)
            k += 1
        row = GROUP * group
        for step, total in enumerate((a0, a1, a2, a3)):
            power = load(bench.powers, table.degree[row + step])
            store(local, row + step, fma(total, power, load(local, row + step)))


@jit
def local_to_local(table: Tables, bench: Bench, local: Any) -> None:
    """Children's local terms from `bench.whole`, the parent's.

    place[:3] is the child's center from the parent's, in the parent's radius; place[3] is 1;
    `ratio` is the child's radius in the same unit. `local` is (children, basis).
    """
    raise_monomials(table, bench)
    for lane in range(LANES):
        bench.powers[0, lane] = table.factor[0]
    for n in range(1, bench.powers.shape[0]):
        for lane in range(LANES):
            bench.powers[n, lane] = bench.powers[n - 1, lane] * bench.ratio[lane]
    nothing = spread(table.factor[0] - table.factor[0])
    for row in range(table.kept.size):
        total = nothing
        for k in range(table.down_first[row], table.down_first[row + 1]):
            term = spread(bench.whole[table.down[k, 0]])
            total = fma(term, load(bench.monomials, table.down[k, 1]), total)
        store(bench.sums, row, fma(total, load(bench.powers, table.degree[row]), nothing))
        for child in range(local.shape[0]):
            local[child, row] = bench.sums[row, child]


@jit
def local_to_particles(
    table: Tables, bench: Bench, target: Any, count: Any, scale: Any, potential: bool, total: Any
) -> None:
    """Add the field of `bench.whole` at `count` targets, rows x, y, z from the cell's center.

    `scale` is one over the cell's radius. The gradient goes to rows 0 to 2 of `total`, and with
    `potential` the sum itself to row 4.
    """
    one = table.factor[0]
    nothing = spread(one - one)
    for first in range(0, count, LANES):
        for lane in range(LANES):
            i = min(first + lane, count - 1)
            for axis in range(3):
                bench.place[axis, lane] = target[axis, i] * scale
            bench.place[3, lane] = one
        raise_monomials(table, bench)
        gx = gy = gz = value = nothing
        for row in range(table.next.shape[1]):
            monomial = load(bench.monomials, row)
            gx = fma(monomial, spread(bench.whole[table.next[0, row]]), gx)
            gy = fma(monomial, spread(bench.whole[table.next[1, row]]), gy)
            gz = fma(monomial, spread(bench.whole[table.next[2, row]]), gz)
        if potential:
            for row in range(bench.whole.size):
                value = fma(load(bench.monomials, row), spread(bench.whole[row]), value)
        for axis, lanes in enumerate((gx, gy, gz, value)):
            store(bench.place, axis, lanes)
        for lane in range(min(LANES, count - first)):
            for axis in range(3):
                total[axis, first + lane] += bench.place[axis, lane] * scale
            if potential:
                total[4, first + lane] += bench.place[3, lane]
