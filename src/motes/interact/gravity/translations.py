"""The operations on expansions: particles to moments, moments to moments, local terms to field.

Lengths are in units of a cell's radius h and, between two cells, of their distance R, so that no
power under- or overflows in single precision: moments are kept as M_b / h^|b| and local terms as
L_a h^|a|. Up to LANES particles, children or source cells go through an operation together; each
operation is straight-line code for its order.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from motes.interact.gravity.expansions import (
    UNITS,
    folded,
    monomials,
    plus,
    powers,
    products,
    shifted_moments,
    shifted_terms,
    terms,
    unfolded,
)
from motes.machine.traced import (
    LANES,
    gathered,
    ones,
    rows,
    scattered,
    total,
    traced,
    write,
    write_totals,
)

FAMILY = 8
"""Lanes of operations on a cell and its children, of which there are no more."""

Operation = Callable[..., None]


class Translations(NamedTuple):
    """The operations of one order, for kernels. `place` is (5, width) for particles, or (5, FAMILY)
    for a cell's children."""

    particles_to_moments: Operation
    """(place, sums): add to `sums` (every, width) those of particles at -place[:3], masses
    place[3], in units of the cell's radius."""
    sums_to_moments: Operation
    """(sums, moments): the moments (basis,) of a cell."""
    moments_to_moments: Operation
    """(place, chosen, table, moments): moments (basis,) of a cell from rows `chosen` of a table,
    those of its children; place[:3] is the parent's center from the child's and place[4] the
    child's radius, in the parent's radius; place[3] is 1, and 0 in unused lanes."""
    lanes_to_local: Operation
    """(local, terms): add the lane sums of `local` (basis, width) to terms (basis,)."""
    local_to_local: Operation
    """(place, terms, table, first): terms of a cell's children in rows `first` + lane of a table;
    place[:3] is the child's center from the cell's, and place[4] its radius, in the cell's."""
    local_to_particles: Operation
    """(place, terms, scale, out): to rows 0 to 2 of `out` the gradient at place[:3], in the cell's
    radius, times `scale`, and to row 3 the value."""
    basis: int
    """Numbers in an expansion."""
    every: int
    """Terms in all."""


@cache
def translations(order: int, harmonic: bool, real: type) -> Translations:
    """The operations on expansions of one order, of numbers of type `real`."""
    lanes = width(real)
    wide, of_children = partial(traced, lanes=lanes), partial(traced, lanes=FAMILY)
    kind = terms(order, harmonic)
    basis, every = kind.basis, kind.every

    @wide
    def particles_to_moments(place: Any, sums: Any) -> None:
        found = monomials(order, (place[0], place[1], place[2]), place[3])
        write(sums, [old + found[t] for t, old in zip(every, rows(sums, len(every)), strict=True)])

    @wide
    def sums_to_moments(sums: Any, moments: Any) -> None:
        whole = dict(zip(every, rows(sums, len(every)), strict=True))
        write_totals(moments, folded(kind, whole))

    @of_children
    def moments_to_moments(place: Any, chosen: Any, table: Any, moments: Any) -> None:
        power = powers(order, place[4], place[3])
        given = gathered(table, chosen, len(basis), FAMILY)
        old = {b: m * power[sum(b)] for b, m in zip(basis, given, strict=True)}
        new = shifted_moments(kind, old, (place[0], place[1], place[2]))
        write_totals(moments, folded(kind, new))

    @wide
    def lanes_to_local(local: Any, terms: Any) -> None:
        for row in range(len(basis)):
            terms[row] = terms[row] + total(local[row])

    @of_children
    def local_to_local(place: Any, terms: Any, table: Any, first: Any) -> None:
        whole = unfolded(kind, rows(terms, len(basis)))
        power = powers(order, place[4], ones(place[4]))
        new = shifted_terms(kind, whole, (place[0], place[1], place[2]))
        scattered([v * power[sum(a)] for a, v in zip(basis, new, strict=True)], table, first)

    @wide
    def local_to_particles(place: Any, terms: Any, scale: Any, out: Any) -> None:
        whole = unfolded(kind, rows(terms, len(basis)))
        shift = monomials(order, (place[0], place[1], place[2]), ones(place[0]))
        inner = [t for t in every if sum(t) < order]
        sums = [[(whole[plus(t, unit)], shift[t]) for t in inner] for unit in UNITS]
        x, y, z, value = products([*sums, [(whole[t], shift[t]) for t in every]])
        out[0], out[1], out[2], out[3] = x * scale, y * scale, z * scale, value

    return Translations(
        particles_to_moments,
        sums_to_moments,
        moments_to_moments,
        lanes_to_local,
        local_to_local,
        local_to_particles,
        len(basis),
        len(every),
    )


def width(real: type) -> int:
    """Numbers in a register: more at a time would leave fewer registers and less of the cache."""
    return LANES * np.dtype(np.float32).itemsize // np.dtype(real).itemsize


def padded(count: int) -> int:
    """Columns of a table of expansions of `count` numbers."""
    return -(-count // LANES) * LANES
