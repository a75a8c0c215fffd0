"""Why a particle became infinite: in which step, and the force that pushed hardest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from motes.appearance import interpolated
from motes.catalog import Component
from motes.control.constant import Setting
from motes.control.control import Control
from motes.control.curve import Curve
from motes.view import View

if TYPE_CHECKING:
    from motes.simulation import Simulation

AFFORDABLE = 2e9
"""Particle-steps that are run again to find the step in which it happened: some seconds."""

ADVICE = "Try a smaller step, a softening above 0, or another integrator."


def explain_infinity(simulation: Simulation, name: str, row: int) -> str:
    """One line that names the particle, the time, the force that contributed most, and a remedy."""
    particle = simulation[name].id[row]
    who = f'system "{name}": particle {int(particle):016x} became infinite'
    if simulation.work > AFFORDABLE:
        return f"{who} by t = {simulation.time:.4g} s. {ADVICE}"
    again = type(simulation)(simulation.scene)
    while again.steps < simulation.steps:
        before = _row(again, name, particle)
        again.run(steps=1, checked=False)
        after = _row(again, name, particle)
        if after is not None and not _finite(again[name], after):
            cause = _strongest(again, name, before)
            return f"{who} at t = {again.time:.4g} s{cause}. {ADVICE}"
    return f"{who} by t = {simulation.time:.4g} s. {ADVICE}"


def _row(
    simulation: Simulation, name: str, particle: np.uint64
) -> tuple[dict[str, Any], int] | None:
    """A particle's own numbers in a simulation, copied, or None when it is not there."""
    view = simulation[name]
    rows = np.flatnonzero(view.id == particle)
    if rows.size == 0:
        return None
    return {key: np.array(view[key][rows[0]]) for key in view.columns}, int(rows[0])


def _finite(view: View, found: tuple[dict[str, Any], int]) -> bool:
    numbers, _ = found
    return bool(np.isfinite(numbers["position"]).all() and np.isfinite(numbers["velocity"]).all())


def _strongest(simulation: Simulation, name: str, before: tuple[dict[str, Any], int] | None) -> str:
    """The force that accelerated the particle most before the step, in words."""
    if before is None:
        return ", in the step of its birth"
    numbers, _ = before
    best, who = -1.0, ""
    for address, force in simulation.forces(name):
        size = float(np.linalg.norm(_acceleration(force, address, numbers, simulation.time)))
        if not size <= best:  # NaN wins.
            best, who = size, force.name
    return f'; force "{who}" contributed {best:.2g} m/s2' if who else ""


def _acceleration(force: Component, address: str, numbers: dict[str, Any], time: float) -> Any:
    """A force's acceleration of one particle, by its uncompiled kernel."""
    p = SimpleNamespace(
        **{
            key: _value(force.values[key], f"{address}.{key}", numbers, time)
            for key in force.parameters
        }
    )
    x, y, z = numbers["position"].astype(float)
    vx, vy, vz = numbers["velocity"].astype(float)
    rest = {key: value.tolist() for key, value in numbers.items() if key.isidentifier()}
    q = SimpleNamespace(**{**rest, "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz})
    with np.errstate(all="ignore"):
        direct = force.kernel("acceleration")
        if direct is not None:
            return np.array(direct(p, q, time), float)
        relaxation = force.kernel("relaxation")
        assert relaxation is not None
        rate, *goal = relaxation(p, q, time)
        return rate * (np.array(goal) - (vx, vy, vz))


def _value(control: Control, address: str, numbers: dict[str, Any], time: float) -> Any:
    """A parameter's value for one particle."""
    if isinstance(control, Setting):
        return control.value
    if control.scope == "scene":
        value = control.at(time)
    elif control.scope == "birth":
        value = np.atleast_1d(numbers[address])
    else:
        assert isinstance(control, Curve)
        speed = np.linalg.norm(numbers["velocity"])
        place = numbers["age"] / numbers["life"] if control.over == "life" else speed
        value = interpolated(control, np.atleast_1d(place))[0]
    return float(value[0]) if control.width == 1 else tuple(float(v) for v in value)
