"""Laws of matter: Lennard-Jones against published figures, collisions, structure."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import catalog
from motes.matter import lj_melt, radial_distribution, thermo

NIST = """
1.077169909511 -1.020988125886 -1.348259447733; 0.1830884592213 -1.557698231574 -1.782405485883
-2.060346185437 3.92737827629 3.88955511529; 1.936298049102 0.7181973326223 3.715169082037
-0.75141390417 -0.4184139469527 -3.250183630687; 2.257391305584 -1.126577405146 -2.291542913197
0.1208868721243 -1.39561152 2.003709382777; 3.327427055092 -1.476502868105 3.39402389845
2.130927328546 -1.106827632561 -0.1972896367169; 2.117442019559 -0.1844743512029 0.9301638993772
-1.45937811958 2.382882188329 -3.78819940147; 2.432313424884 -1.11853791544 -1.224088264651
2.41684536653 1.845499053895 2.906107003288; 2.51524791205 0.03580976978134 -2.445590080636
1.113585242376 -2.478011342991 -0.00809218952796; 1.261664073561 1.075432348722 -2.751715752259
-0.5811873476022 -2.429378395199 2.668996832737; -1.533182296119 2.319699660489 1.762429379767
2.639946585704 -0.7847515599358 2.251233247739; -1.927486378623 -1.432729425739 -2.439226375584
0.921280135544 -2.427925517025 2.150024430246; 2.114172305774 0.9586575168591 -1.790678078404
-0.7312380271746 -3.366157234697 0.1376597954432; 1.612569300954 -0.9233415846164 2.037484769332
3.967911812136 0.2002508998947 2.659432175592; 1.188751191387 -0.05955638413419 -0.7363070447875
3.789497702433 1.570674334424 0.726591837482; 2.786625773109 -1.524167484397 0.8358187540631
-1.629362446504 -1.139061532617 -0.7654084051377; 2.592655226763 3.786335083587 -1.252452130644
"""
"""Configuration 4 of NIST's standard reference simulations of the Lennard-Jones fluid, L = 8."""


def atoms(law: Any, x: Any, v: Any = 0.0, size: Any = (0, 0, 0), **settings: Any) -> Any:
    """A simulation of atoms at given places."""
    chosen = {"precision": "double", "integrator": "leapfrog", "step": 0.005, **settings}
    interact = law if isinstance(law, list) else [law]
    low = tuple(-s / 2 for s in size)
    scene = motes.Scene(
        systems=[motes.System("atoms", size=0.5)], interact=interact,
        periodic={"low": low, "size": size}, **chosen,
    )  # fmt: skip
    sim = motes.Simulation(scene)
    sim.place("atoms", x, v)
    return sim


@pytest.mark.parametrize(
    ("cutoff", "energy", "virial"),
    [(3.0, -16.7903213046, -46.2491967463), (4.0, -17.0604532203, -47.8688281911)],
)
def test_the_reference_configuration_of_nist(cutoff: float, energy: float, virial: float) -> None:
    """Energy and virial of 30 particles; NIST prints -16.790 and -46.249 for the first cutoff."""
    x = np.array([[float(n) for n in p.split()] for p in NIST.replace("\n", ";").split(";") if p])
    assert x.shape == (30, 3)
    sim = atoms(motes.interact.LennardJones(cutoff=cutoff), x, size=(8.0, 8.0, 8.0))
    assert sim.measure().potential == pytest.approx(energy, abs=1e-9)
    assert thermo(sim).virial == pytest.approx(virial, abs=1e-9)


def test_the_melt_of_lammps() -> None:
    """Its log files print these figures at steps 0 and 100 (bench/in.lj; 2016 and 2019 agree)."""
    sim = lj_melt(cells=20, precision="double")
    start = thermo(sim)
    assert start.temperature == pytest.approx(1.44, abs=1e-12)
    assert start.potential == pytest.approx(-6.7733681, abs=5e-8)
    assert start.total == pytest.approx(-4.6134356, abs=5e-8)
    assert start.pressure == pytest.approx(-5.0197073, abs=5e-8)
    sim.run(steps=100)
    end = thermo(sim)
    assert end.temperature == pytest.approx(0.7574531, abs=5e-8)
    assert end.potential == pytest.approx(-5.7585055, abs=5e-8)
    assert end.total == pytest.approx(-4.6223613, abs=5e-8)
    assert end.pressure == pytest.approx(0.20726105, abs=5e-9)
    assert end.pairs == 1202833
    assert np.abs(sim.measure().momentum).max() < 1e-14 * 32000


def test_lists_that_miss_no_pair_give_nearly_the_same_melt() -> None:
    """Lists built every 20 steps miss pairs of fast atoms: the energy differs by parts in 1e6."""
    melt = lj_melt(cells=6)
    ends = []
    for rebuild in (20, 1, 0):
        law = motes.interact.LennardJones(cutoff=2.5, skin=0.12, rebuild=rebuild)
        sim = motes.Simulation(melt.scene.model_copy(update={"interact": (law,)}))
        sim.place("atoms", melt["atoms"].position, melt["atoms"].velocity)
        sim.run(steps=60)
        ends.append(sim.measure().energy / sim.count)
    assert abs(ends[1] - ends[2]) < 1e-9
    assert 1e-9 < abs(ends[0] - ends[2]) < 1e-3


@pytest.mark.parametrize(
    ("truncation", "energy"),
    [
        ("plain", 4 * (2.5**-12 - 2.5**-6)),
        ("shift", -0.0108374493917612),
        ("force_shift", -0.00536553435321508),
    ],
)
def test_truncations_of_a_pair(truncation: str, energy: float) -> None:
    """U(2.5) with a cutoff of 3; beyond it there is nothing."""
    law = motes.interact.LennardJones(cutoff=3.0, truncation=truncation)
    sim = atoms(law, [[0.0, 0, 0], [1.5, 2.0, 0]])
    assert sim.measure().potential == pytest.approx(energy, rel=1e-12)
    far = atoms(law, [[0.0, 0, 0], [1.801, 2.4, 0]])
    assert far.measure().potential == 0.0


def drift(steps: int) -> float:
    """Largest relative change of the energy of a melt with a force-shifted law, once melted."""
    melt = lj_melt(cells=4)
    law = motes.interact.LennardJones(cutoff=2.5, truncation="force_shift", skin=0.15)
    sim = motes.Simulation(melt.scene.model_copy(update={"interact": (law,), "step": 0.002}))
    sim.place("atoms", melt["atoms"].position, melt["atoms"].velocity)
    sim.run(steps=400)
    energies = []
    for _ in range(20):
        sim.run(steps=steps // 20)
        energies.append(sim.measure().energy)
    line = np.polyfit(np.linspace(0, 1, 20), energies, 1)
    return abs(float(line[0] / np.mean(energies)))


def test_energy_does_not_drift() -> None:
    """NVE: the trend of the energy over 10 000 steps is below 1e-4 of it."""
    assert drift(10_000) < 1e-4


@pytest.mark.slow
def test_energy_does_not_drift_in_the_long_run() -> None:
    """NVE: the trend of the energy over 100 000 steps is below 1e-4 of it."""
    assert drift(100_000) < 1e-4


def test_species_mix_by_lorentz_and_berthelot() -> None:
    """sigma_ab = (sigma_a + sigma_b) / 2, epsilon_ab = sqrt(epsilon_a epsilon_b)."""
    own = {"a": {"epsilon": 2.0, "sigma": 1.1}, "b": {"epsilon": 0.5, "sigma": 0.7}}
    systems = [motes.System("a"), motes.System("b")]
    for mixing, sigma in (("lorentz_berthelot", 0.9), ("geometric", math.sqrt(0.77))):
        law = motes.interact.LennardJones(cutoff=3.0, species=own, mixing=mixing)
        sim = motes.Simulation(motes.Scene(systems=systems, interact=[law], precision="double"))
        sim.place("a", [[0.0, 0, 0], [9.0, 0, 0], [9.0, 1.2, 0]])
        sim.place("b", [[1.0, 0, 0], [0, 9.0, 0], [0, 9.0, 0.8]])

        def pair(epsilon: float, sigma: float, r: float) -> float:
            return 4 * epsilon * ((sigma / r) ** 12 - (sigma / r) ** 6)

        expected = pair(1.0, sigma, 1.0) + pair(2.0, 1.1, 1.2) + pair(0.5, 0.7, 0.8)
        assert sim.measure().potential == pytest.approx(expected, rel=1e-12)


def test_charges_of_systems_attract_and_repel() -> None:
    """U = k q_a q_b (1/r - 2/R + r/R^2)."""
    own = {"salt": {"charge": 1.0}, "chloride": {"charge": -2.0}}
    law = motes.interact.Charge(k=1.0, species=own, cutoff=2.0)
    systems = [motes.System("salt"), motes.System("chloride")]
    sim = motes.Simulation(motes.Scene(systems=systems, interact=[law], precision="double"))
    sim.place("salt", [[0.0, 0, 0]])
    sim.place("chloride", [[0.8, 0, 0]])
    expected = -2.0 * (1 / 0.8 - 1.0 + 0.2)
    assert sim.measure().potential == pytest.approx(expected, rel=1e-12)


LAWS = [
    c for c in catalog("interact").values() if c.kernel("force") and c.__module__[:5] == "motes"
]


@pytest.mark.parametrize("part", LAWS, ids=lambda c: c.type)
def test_every_pair_law_keeps_momentum(part: Any) -> None:
    """sum m v = 0 to rounding, and forces act."""
    reach = part.kernel("reach")(SimpleNamespace(**{k: getattr(part(), k) for k in part.own}))
    x = np.random.default_rng(3).uniform(-0.8 * reach, 0.8 * reach, (20, 3))
    sim = atoms(part(), x, step=1e-9)
    sim.run(steps=3)
    v = sim["atoms"].velocity
    assert np.abs(v).max() > 0
    assert np.abs(v.sum(axis=0)).max() < 1e-13 * np.abs(v).sum()


def test_hard_spheres_bounce_with_restitution() -> None:
    """Head on: the relative velocity is -e times what it was; momentum stays."""
    law = motes.interact.HardSpheres(restitution=0.7, friction=0.0)
    sim = atoms(law, [[-0.6, 0, 0], [0.6, 0, 0]], [[1.0, 0, 0], [-0.5, 0, 0]])
    sim.run(steps=200)
    v = sim["atoms"].velocity[np.argsort(sim["atoms"].position[:, 0])]
    assert v[1, 0] - v[0, 0] == pytest.approx(0.7 * 1.5, rel=1e-12)
    assert v.sum(axis=0) == pytest.approx([0.5, 0, 0], abs=1e-12)
    assert np.linalg.norm(np.diff(sim["atoms"].position, axis=0)) > 0.5


def test_a_gas_of_hard_spheres_keeps_momentum_and_cools() -> None:
    """sum m v stays to rounding; so does the energy with e = 1, and falls with e < 1."""
    rng = np.random.default_rng(2)
    x = (np.stack(np.meshgrid(*[np.arange(8)] * 3), -1).reshape(-1, 3) - 3.5) * 0.6
    v = rng.normal(size=x.shape)
    for e, low, high in ((1.0, 1 - 1e-12, 1 + 1e-12), (0.8, 0.1, 0.9)):
        law = motes.interact.HardSpheres(restitution=e, friction=0.0, rest_speed=0.0)
        sim = atoms(law, x, v, size=(4.8, 4.8, 4.8), step=0.002)
        sim.run(steps=300)
        measures = sim.measure()
        assert np.abs(measures.momentum - v.sum(axis=0)).max() < 1e-11
        assert low < measures.kinetic / (0.5 * (v**2).sum()) < high


def test_the_radial_distribution_of_a_crystal_and_of_a_gas() -> None:
    """g = 1 for points without order; 12 nearest neighbours in a face-centred cubic crystal."""
    x = np.random.default_rng(0).random((4000, 3)) * 10
    r, g = radial_distribution(x, 10.0, 3.0, 30)
    assert g[5:] == pytest.approx(1.0, abs=0.05)
    crystal = lj_melt(cells=5)
    size = crystal.scene.periodic.size[0]
    r, g = radial_distribution(crystal["atoms"].position, size, 2.0, 200)
    shell = 4 * np.pi * r**2 * (r[1] - r[0]) * 500 / size**3
    first = (r > 1.1) & (r < 1.3)
    assert (g * shell)[first].sum() == pytest.approx(12, rel=0.01)
    with pytest.raises(ValueError, match="cutoff"):
        radial_distribution(x, 10.0, 6.0)


def test_the_radial_distribution_is_its_double_loop() -> None:
    """g(r) = V / N^2 sum_i sum_j delta(r - r_ij) / (4 pi r^2), averaged over each bin's shell."""
    size = np.array([4.0, 5.0, 6.0])
    x = np.random.default_rng(7).random((60, 3)) * size
    r, g = radial_distribution(x, size, 1.9, 19)
    assert r == pytest.approx(0.05 + 0.1 * np.arange(19))
    away = x[:, None] - x
    away -= size * np.round(away / size)
    length = np.sqrt((away**2).sum(axis=2))[~np.eye(60, dtype=bool)]
    for k, value in enumerate(g):
        low, high = 0.1 * k, 0.1 * (k + 1)
        count = ((length >= low) & (length < high)).sum()
        shell = 4 * np.pi / 3 * (high**3 - low**3)
        assert value == pytest.approx(120.0 / 60**2 * count / shell, rel=1e-12)


def test_faults_of_matter_are_said_in_one_line() -> None:
    with pytest.raises(ValueError, match="at least 4"):
        lj_melt(cells=3)
    with pytest.raises(motes.SceneError, match=r'no "sigm"\. Did you mean "sigma"'):
        motes.interact.LennardJones(species={"a": {"sigm": 1.0}})
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        lj_melt(cells=4).place("atoms", [[1.0, 2.0]])
    emitter = motes.emit.Point()
    drawn = motes.System("a", emit=[emitter], mass={"mean": 1.0, "spread": 0.5})
    sim = motes.Simulation(motes.Scene(systems=[drawn]))
    with pytest.raises(motes.SceneError, match="cannot draw"):
        sim.place("a", [[0.0, 0, 0]])


def test_a_pile_of_hard_spheres_comes_to_rest() -> None:
    """What is left is what gravity adds in a few steps, (g h)^2 / 2 each; nobody sinks in."""
    floor = {"type": "plane", "position": (0, 0, 0.05)}
    sides = [
        {"type": "plane", "name": name, "position": at, "rotation": turn}
        for name, at, turn in (
            ("left", (-0.2, 0, 0), (0, 90, 0)), ("right", (0.2, 0, 0), (0, -90, 0)),
            ("back", (0, 0.2, 0), (90, 0, 0)), ("front", (0, -0.2, 0), (-90, 0, 0)),
        )
    ]  # fmt: skip
    scene = motes.Scene(
        systems=[motes.System("grains", size=0.1)],
        interact=[motes.interact.HardSpheres(restitution=0.35, friction=0.45)],
        force=[motes.force.Gravity()], solid=[floor, *sides], step=0.004,
        integrator="semi_implicit_euler",
    )  # fmt: skip
    sim = motes.Simulation(scene)
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 2, np.arange(14)), -1).reshape(-1, 3)
    jitter = np.random.default_rng(3).random(grid.shape) * 0.02
    sim.place("grains", (grid - [1.5, 1.5, -1]) * 0.12 * [0.8, 0.8, 1] + jitter)
    sim.run(until=3.0)
    speeds = (sim["grains"].velocity ** 2).sum(axis=1)
    assert 0.5 * speeds.mean() < 4 * 0.5 * (9.81 * 0.004) ** 2
    assert sim["grains"].position[:, 2].min() > 0.05 - 1e-3
    assert sim["grains"].position[:, 2].max() > 0.8


def test_energy_and_pressure_are_those_of_thermo() -> None:
    sim = lj_melt(cells=4)
    state = thermo(sim)
    kinetic, potential = motes.matter.energy(sim)
    assert kinetic == pytest.approx(1.5 * 1.44 * (sim.count - 1), rel=1e-12)
    assert potential == pytest.approx(-6.7733681 * sim.count, rel=1e-7)
    assert kinetic + potential == pytest.approx(state.total * sim.count, rel=1e-14)
    volume = np.prod(sim.scene.periodic.size)
    assert motes.matter.virial(sim) == state.virial
    expected = (2 * kinetic + state.virial) / (3 * volume)
    assert motes.matter.pressure(sim) == pytest.approx(expected, rel=1e-14)
    assert motes.matter.temperature(sim, 2.0) == pytest.approx(1.44 / 2, rel=1e-12)


def test_local_order_knows_periodic_space() -> None:
    """A crystal without a surface is in order everywhere; shaken, nowhere."""
    crystal = lj_melt(cells=4)
    x, size = crystal["atoms"].position, crystal.scene.periodic.size
    assert motes.matter.local_order(x, size).min() > 1 - 1e-9
    assert motes.matter.local_order(x).min() < 0.1
    shaken = x + np.random.default_rng(1).normal(size=x.shape) * 0.35
    order = motes.matter.local_order(shaken, size)
    assert np.median(order) < 0.25
    moved = (shaken + np.array([1.3, 2.9, 0.4])) % np.array(size)
    assert motes.matter.local_order(moved, size) == pytest.approx(order, abs=1e-9)


def test_local_order_is_its_formula() -> None:
    """1 - 14 c, c the six smallest |r_i + r_j|^2 of twelve neighbours over 2 sum |r_k|^2."""
    crystal = lj_melt(cells=4)
    x = crystal["atoms"].position + np.random.default_rng(2).normal(size=(256, 3)) * 0.08
    size = np.array(crystal.scene.periodic.size)
    order = motes.matter.local_order(x, size)
    for k in (0, 100, 255):
        away = x - x[k]
        away -= size * np.round(away / size)
        near = away[np.argsort((away**2).sum(axis=1))[1:13]]
        sums = sorted(((a + b) ** 2).sum() for i, a in enumerate(near) for b in near[i + 1 :])
        centrosymmetry = sum(sums[:6]) / (2 * (near**2).sum())
        assert 0.01 < 14 * centrosymmetry < 0.9
        assert order[k] == pytest.approx(1 - 14 * centrosymmetry, rel=1e-9)


def test_a_ball_is_brightest_where_it_faces_the_light() -> None:
    """Lambert's law in steps: smaller, brighter dots, each nearer to the light, within the ball."""
    light = np.array([0.6, 0.0, 0.8])
    p = SimpleNamespace(light=tuple(3 * light), shade=0.25)
    parts = catalog("look")["balls"].kernel("figure")(p, 0.0, 0.0)
    places, sizes = np.array([q[:3] for q in parts]), np.array([q[3] for q in parts])
    tones = np.array([q[4] for q in parts])
    assert tones[0] == pytest.approx(0.25)
    assert tones[2] == pytest.approx(1.0)
    assert (np.diff(tones) > 0).all()
    assert (np.diff(sizes) < 0).all()
    along = places @ light
    assert (np.diff(along) > 0).all()
    assert np.linalg.norm(places - along[:, None] * light, axis=1).max() < 1e-12
    assert (along + sizes / 2 <= 0.5 + 1e-9).all()  # In units of the ball's diameter.
