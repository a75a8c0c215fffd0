"""A crystal: particles on a lattice."""

from motes.catalog import Integer, Number, component, quantity
from motes.kernel import floor, kernel


@component
class Crystal:
    """Births on the sites of a face-centred cubic lattice, cell after cell, along x first.

    The k-th birth is at site k of the lattice, whose corner is the emitter's position; a burst of
    4 columns rows layers particles fills it.
    """

    spacing: Number = quantity(1.0, "m", above=0)
    """Edge of the cubic cell, which holds four particles."""

    columns: Integer = quantity(5, at_least=1)
    """Cells along x."""

    rows: Integer = quantity(5, at_least=1)
    """Cells along y."""

    layers: Integer = quantity(5, at_least=1)
    """Cells along z; further births start again from the first."""

    draws = 2

    @kernel
    def birth(p, u, t, k):
        cell = floor(k * 0.25)
        site = k - 4.0 * cell
        line = floor((cell + 0.5) / p.columns)
        layer = floor((line + 0.5) / p.rows)
        x = cell - p.columns * line
        y = line - p.rows * layer
        z = layer - p.layers * floor((layer + 0.5) / p.layers)
        half_x = 0.5 if (site == 1.0) | (site == 2.0) else 0.0
        half_y = 0.5 if (site == 1.0) | (site == 3.0) else 0.0
        half_z = 0.5 if (site == 2.0) | (site == 3.0) else 0.0
        return (
            p.spacing * (x + half_x),
            p.spacing * (y + half_y),
            p.spacing * (z + half_z),
            0.0,
            0.0,
            0.0,
        )
