"""Matter: what atoms that attract and repel each other have as a whole.

Temperature, pressure and structure of a simulation whose particles feel pair laws, and the system
of a well-known benchmark. In reduced units, energies are in epsilon and lengths in sigma, and
Boltzmann's constant is 1. Source: Allen and Tildesley, Computer Simulation of Liquids (2017).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from motes.simulation import Simulation

__all__ = [
    "Thermo", "energy", "lj_melt", "local_order", "pressure", "radial_distribution", "temperature",
    "thermo", "virial",
]  # fmt: skip


@dataclass(frozen=True)
class Thermo:
    """State of matter at one instant, in double precision."""

    temperature: float
    """2 E_kin / (dof k), dof = 3 N - 3 in a periodic box, where the total momentum is constant."""

    potential: float
    """Potential energy per particle [J]."""

    total: float
    """Kinetic and potential energy per particle [J]."""

    pressure: float
    """(2 E_kin + W) / (3 V) [Pa], W = sum over pairs r f; NaN where space is not a periodic box."""

    virial: float
    """W = sum over pairs r f [J]."""

    pairs: int
    """Pairs within the longest reach and its skin."""


def thermo(sim: Simulation, boltzmann: float = 1.0) -> Thermo:
    """Temperature, energies, pressure and pairs of all particles of a simulation, now.

    `boltzmann`: Boltzmann's constant k [J/K]; 1 in reduced units, 1.380649e-23 in SI units.
    Source: Allen and Tildesley (2017), equations 2.50 and 2.61.
    """
    from motes.interact.search import Who
    from motes.neighbours import _around

    measures, n = sim.measure(), sim.count
    virial = float(np.trace(sim.virial()))
    size = np.asarray(sim.scene.periodic.size, float)
    closed = bool((size > 0).all())
    freedom = 3 * n - 3 if (size > 0).any() else 3 * n
    pairs = 0
    if radius := sim.listed_radius():
        low = np.asarray(sim.scene.periodic.low, float)
        x = np.concatenate([sim[s.name].position for s in sim.scene.systems]).astype(float) - low
        box = np.where(size > 0, size, np.inf)
        pairs = int(_around(x, None, radius, box, Who.LATER).first[-1])
    return Thermo(
        temperature=2 * measures.kinetic / (max(freedom, 1) * boltzmann),
        potential=measures.potential / max(n, 1),
        total=measures.energy / max(n, 1),
        pressure=(2 * measures.kinetic + virial) / (3 * float(np.prod(size))) if closed else np.nan,
        virial=virial,
        pairs=pairs,
    )


def energy(sim: Simulation) -> tuple[float, float]:
    """Kinetic and potential energy of all particles of a simulation, now [J].

    Sums of m v^2 / 2, and of U(r) over all pairs. Source: Allen and Tildesley (2017), section 2.4.
    """
    measures = sim.measure()
    return measures.kinetic, measures.potential


def virial(sim: Simulation) -> float:
    """W = sum over pairs r . f, now [J], as Allen and Tildesley (2017), equation 2.60."""
    return thermo(sim).virial


def temperature(sim: Simulation, boltzmann: float = 1.0) -> float:
    """2 E_kin / (dof k), now, as in `thermo`."""
    return thermo(sim, boltzmann).temperature


def pressure(sim: Simulation) -> float:
    """(2 E_kin + W) / (3 V), now [Pa], as in `thermo`; NaN where space is not a periodic box."""
    return thermo(sim).pressure


def radial_distribution(
    x: ArrayLike, box: Any, cutoff: float, bins: int = 100
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Radial distribution function g(r): pairs at a distance over what an ideal gas would have.

    g(r) = V / N^2 sum_i sum_{j != i} delta(r - |x_i - x_j|) / (4 pi r^2).

    `x`: (n, 3) points [m]. `box`: the period, or one for each axis [m]. `cutoff`: the longest
    distance, at most half of the shortest period [m]. Returns the middles of the bins [m] and g,
    each (bins,). Raises ValueError for a cutoff or a box that is not so. Source: Allen and
    Tildesley (2017), equation 2.94.
    """
    from motes.neighbours import pairs

    points = np.asarray(x, float)
    size = np.broadcast_to(np.asarray(box, float), (3,))
    if not 0 < cutoff <= size.min() / 2:
        raise ValueError(f"cutoff = {cutoff} must be above 0 and at most half of the box {box}")
    i, j = pairs(points, cutoff, size)
    away = points[i] - points[j]
    away -= size * np.round(away / size)
    edges = np.linspace(0.0, cutoff, bins + 1)
    count, _ = np.histogram(np.sqrt((away**2).sum(axis=1)), edges)
    shells = 4 / 3 * np.pi * np.diff(edges**3)
    n = max(len(points), 1)
    return (edges[1:] + edges[:-1]) / 2, 2 * count * np.prod(size) / (n * n * shells)


def local_order(x: ArrayLike, box: Any = None) -> NDArray[np.float64]:
    """How much the surroundings of points are those of a crystal, from 0 to 1, (n,).

    max(0, 1 - 14 c), with c the centrosymmetry of the 12 nearest neighbours at r_k: the sum over
    the 6 most opposite pairs of |r_i + r_j|^2, divided by 2 sum |r_k|^2. It is 1 inside a crystal
    with cubic close packing, and near 0 in a liquid and at a surface. `x`: (n, 3) points [m].
    `box`: the period, or one for each axis [m]; None in open space. Source: Kelchner, Plimpton and
    Hamilton, Physical Review B 58 (1998) 11085, equation 1.
    """
    from motes.neighbours import nearest

    points = np.asarray(x, float)
    order = np.zeros(len(points))
    if len(points) < 13:
        return order
    first, second = np.triu_indices(12, 1)
    neighbours, _ = nearest(points, 12, box)
    size = np.broadcast_to(np.asarray(np.inf if box is None else box, float), (3,))
    closed = np.isfinite(size)
    for begin in range(0, len(points), 1 << 13):
        rows = slice(begin, begin + (1 << 13))
        away = points[neighbours[rows]] - points[rows][:, None]
        away[..., closed] -= size[closed] * np.round(away[..., closed] / size[closed])
        sums = ((away[:, first] + away[:, second]) ** 2).sum(axis=2)
        six = np.sort(sums, axis=1)[:, :6].sum(axis=1)
        whole = 2 * (away**2).sum(axis=(1, 2))
        order[rows] = np.maximum(0.0, 1 - 14 * six / whole)
    return order


def lj_melt(cells: int = 20, precision: str = "double") -> Simulation:
    """The melting crystal that molecular dynamics programs are compared by.

    4 cells^3 atoms on a face-centred cubic lattice of reduced density 0.8442 at T = 1.44 in a
    periodic box, with the Lennard-Jones potential cut off at 2.5 sigma, and a step of 0.005, in
    reduced units; `precision` is "single" or "double". It is an ordinary simulation: run(steps=100)
    melts it.

    Raises ValueError for less than 4 cells, which are too few for the cutoff. Source: the input
    `bench/in.lj` of LAMMPS (Thompson et al., Computer Physics Communications 271 (2022) 108171),
    whose velocities are a function of the atoms' places. Like it, the system builds its lists every
    20 steps, and so misses some pairs: with `rebuild` = 0 the law does not, and the energy after
    100 steps differs in the sixth digit.
    """
    from motes import Periodic, Scene, Simulation, System, interact

    if cells < 4:
        raise ValueError(f"cells = {cells} must be at least 4")
    spacing = (4 / 0.8442) ** (1 / 3)
    scene = Scene(
        title="Melt",
        systems=[System("atoms", size=0.5)],
        interact=[interact.LennardJones(cutoff=2.5, skin=0.12, rebuild=20)],
        periodic=Periodic(size=(spacing * cells,) * 3),
        step=0.005,
        integrator="leapfrog",
        precision=precision,
    )
    sim = Simulation(scene)
    x = spacing * _lattice(cells)
    sim.place("atoms", x, _velocities(x, 1.44))
    return sim


def _lattice(cells: int) -> NDArray[np.float64]:
    """Sites (4 cells^3, 3) of a face-centred cubic lattice of unit cells, along x first."""
    corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1)[..., ::-1]
    basis = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    sites: NDArray[np.float64] = (corner.reshape(-1, 1, 3) + basis).reshape(-1, 3)
    return sites


def _velocities(x: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Velocities (n, 3) without a mean, of a reduced temperature, from a hash of the places.

    The hash is Jenkins' one-at-a-time, the generator that of Park and Miller, Communications of the
    ACM 31 (1988) 1192.
    """
    seed = np.broadcast_to(np.array([87287], "<i4").view(np.int8), (len(x), 4))
    text = np.hstack([seed, np.ascontiguousarray(x, "<f8").view(np.int8)])
    h = np.zeros(len(x), np.uint32)
    for letter in text.T.astype(np.int32).astype(np.uint32):
        h += letter
        h += h << np.uint32(10)
        h ^= h >> np.uint32(6)
    h += h << np.uint32(3)
    h ^= h >> np.uint32(11)
    h += h << np.uint32(15)
    modulus = 2**31 - 1
    state = np.maximum(h & np.uint32(0x7FFFFFF), np.uint32(1)).astype(np.int64)
    for _ in range(5):
        state = 16807 * state % modulus
    v = np.empty_like(x)
    for axis in range(3):
        state = 16807 * state % modulus
        v[:, axis] = state / modulus - 0.5
    v -= v.mean(axis=0)
    scaled: NDArray[np.float64] = v * np.sqrt(temperature * (3 * len(x) - 3) / (v**2).sum())
    return scaled
