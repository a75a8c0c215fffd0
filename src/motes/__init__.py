"""motes: a particle-system engine and studio.

Emitters make particles, forces and flows move them, an integrator advances them, solids bounce
them, a renderer draws them, and every number is a control. Start with `motes.load("sprinkler")`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motes import (
        emit,
        flow,
        force,
        gravity,
        interact,
        look,
        matter,
        neighbours,
        ode,
        retire,
        solid,
    )
    from motes.catalog import (
        Color,
        Flag,
        Integer,
        Number,
        Vector,
        component,
        quantity,
    )
    from motes.errors import (
        MemoryBudgetError,
        MissingExtra,
        MotesError,
        OutputError,
        SceneError,
        SimulationError,
    )
    from motes.frame import Frame
    from motes.jit import threads
    from motes.production import film, redraw
    from motes.scene import Camera, Film, Periodic, Scene, Sky, System, load
    from motes.simulation import Simulation
    from motes.studio import Studio
    from motes.studio import picture as render

__all__ = [
    "Camera",
    "Color",
    "Film",
    "Flag",
    "Frame",
    "Integer",
    "MemoryBudgetError",
    "MissingExtra",
    "MotesError",
    "Number",
    "OutputError",
    "Periodic",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "Sky",
    "Studio",
    "System",
    "Vector",
    "component",
    "emit",
    "film",
    "flow",
    "force",
    "gravity",
    "interact",
    "load",
    "look",
    "matter",
    "neighbours",
    "ode",
    "quantity",
    "redraw",
    "render",
    "retire",
    "solid",
    "threads",
]

_HOMES = {
    "Color": "catalog",
    "Flag": "catalog",
    "Integer": "catalog",
    "Number": "catalog",
    "Vector": "catalog",
    "component": "catalog",
    "quantity": "catalog",
    "MemoryBudgetError": "errors",
    "MissingExtra": "errors",
    "MotesError": "errors",
    "OutputError": "errors",
    "SceneError": "errors",
    "SimulationError": "errors",
    "Frame": "frame",
    "threads": "jit",
    "film": "production",
    "redraw": "production",
    "Camera": "scene",
    "Film": "scene",
    "Periodic": "scene",
    "Scene": "scene",
    "Sky": "scene",
    "System": "scene",
    "load": "scene",
    "Simulation": "simulation",
    "Studio": "studio",
    "render": "studio:picture",
}
"""Module of each public name: it is imported when the name is first used, so that `import motes` is
quick."""


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        module, _, other = _HOMES[name].partition(":")
        value = getattr(importlib.import_module(f"motes.{module}"), other or name)
    elif name in __all__:
        value = importlib.import_module(f"motes.{name}")
    else:
        raise AttributeError(f"module motes has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
