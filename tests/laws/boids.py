"""A cloud of boids for the tests of flocks."""

from __future__ import annotations

from typing import Any

import numpy as np

import motes

RULES = {
    "separation": {"radius": 0.8, "strength": 3.0},
    "alignment": {"radius": 1.5, "rate": 1.0, "angle": 100.0},
    "cohesion": {"radius": 2.0, "strength": 2.0, "angle": 125.0},
}


def rules() -> list[Any]:
    return [
        motes.interact.Separation(**RULES["separation"]),
        motes.interact.Alignment(**RULES["alignment"]),
        motes.interact.Cohesion(**RULES["cohesion"]),
    ]


def flock(n: int = 300, **settings: Any) -> motes.Simulation:
    """A cloud of boids of about twenty neighbours, without a step taken."""
    emitter = motes.emit.Box(
        burst=[{"count": n}], size=(settings.pop("size", 6.0),) * 3,
        velocity={"low": [-1, -1, -1], "high": [2, 1, 1]},
    )  # fmt: skip
    known = {"precision": "double", "integrator": "semi_implicit_euler", "step": 0.02, "seed": 4}
    system = motes.System("boids", emit=[emitter], force=settings.pop("force", []))
    return motes.Simulation(
        motes.Scene(systems=[system], interact=rules(), **{**known, **settings})
    )


def born(sim: motes.Simulation) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities at birth, of the same flock without laws: x and v at time 0, by id."""
    bare = sim.scene.model_copy(update={"interact": ()})
    other = motes.Simulation(bare)
    other.run(steps=1)
    view, order = other["boids"], np.argsort(other["boids"].id)
    v = view.velocity[order]
    return view.position[order] - bare.step * v, v
