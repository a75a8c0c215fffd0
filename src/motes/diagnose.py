"""Why a particle became infinite: the force that pushed hardest, and what to try."""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.compile.system import CompiledSystem
from motes.state import Particles


def explain_infinity(particles: Particles, row: int, system: CompiledSystem, time: float) -> str:
    """One line that names the particle, the time and the likely cause."""
    number = int(particles.ids[row])
    forces = ", ".join(f'"{c.name}"' for _, c in (*system.motion.forces, *system.motion.flows))
    cause = f"Look at {forces}." if forces else "Look at its emitter."
    return (
        f'system "{particles.name}": particle {number:x} (row {row}) became infinite by '
        f"t = {time:.4g} s. {cause} Try a smaller step, a softening above 0, or another integrator."
    )


_: Any = np
