"""A field of gravity among systems, some of which are its sources."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.errors import SceneError, SimulationError
from motes.interact.gravity.trees import Trees

if TYPE_CHECKING:
    from motes.group import Bodies


def pulls(p: Any, body: Bodies) -> bool:
    """Whether a system is among the sources."""
    return not p.sources or body.name in p.sources


def field_among(p: Any, bodies: Sequence[Bodies], field: Callable[..., Any]) -> list[NDArray[Any]]:
    """The sources' `field`, a function of `motes.gravity`, at the particles of each system.

    Arrays (..., n), in the order of `bodies`.

    Raises:
        SceneError: a source does not take part.
        SimulationError: a position became infinite, or the precision cannot keep the tolerance.
    """
    if unknown := sorted(set(p.sources) - {body.name for body in bodies}):
        raise SceneError(f'interaction "gravity": source "{unknown[0]}" does not take part in it.')
    sources = [body for body in bodies if pulls(p, body)]
    x, m = _joined(sources)
    law = {
        "G": p.G,
        "softening": p.softening,
        "softening_kernel": p.softening_kernel,
        "tolerance": p.tolerance or None,
    }
    passive = [body for body in bodies if not pulls(p, body)]
    try:
        found = _parted(field(x.T, m, trees=_trees(sources), **law).T, sources)
        if passive:
            y, _ = _joined(passive)
            trees = _trees([*sources, *passive])
            found |= _parted(field(x.T, m, targets=y.T, trees=trees, **law).T, passive)
    except ValueError as fault:
        raise SimulationError(f'interaction "gravity": {fault}') from None
    return [found[body.name] for body in bodies]


def _trees(bodies: Sequence[Bodies]) -> Trees:
    """Those of the last sum over these systems."""
    found: Trees = bodies[0].kept.setdefault(("gravity", *(b.name for b in bodies)), Trees())
    return found


def _joined(bodies: Sequence[Bodies]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Positions (3, n) and masses (n,) of all; those of a single system are not copied."""
    if len(bodies) == 1:
        return bodies[0].position, bodies[0].mass
    return (
        np.concatenate([body.position for body in bodies], axis=1),
        np.concatenate([body.mass for body in bodies]),
    )


def _parted(values: NDArray[Any], bodies: Sequence[Bodies]) -> dict[str, NDArray[Any]]:
    """Values (..., n) of all, by system."""
    ends = np.cumsum([body.mass.size for body in bodies])[:-1]
    parts = np.split(values, ends, axis=-1)
    return dict(zip([body.name for body in bodies], parts, strict=True))
