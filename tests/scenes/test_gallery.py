"""Every scene of the gallery is told, runs headless, is finite, visible, and the same each time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import motes
from motes.scene.gallery import gallery

SIZE = (96, 54)
"""A picture of this size shows whether anything is there."""

SHOWN = 1.5
"""By this time of its film every scene has begun [s]."""

REPEATED = 0.5
"""So much of it is simulated twice [s]."""

VISIBLE = 3
"""Levels of 255 by which at least one pixel in 500 is changed by the particles."""

WHITE = 0.005
"""Most of a picture that may be at display white, as a share."""


@pytest.mark.parametrize("name", gallery())
def test_a_scene_of_the_gallery_is_worth_a_look(name: str) -> None:
    scene = motes.load(name)
    assert scene.title
    assert scene.about.endswith(".")

    simulation, again = motes.Simulation(scene), motes.Simulation(scene)
    simulation.run(until=REPEATED)
    while again.steps < simulation.steps:
        again.step()
    assert again.digest() == simulation.digest()
    simulation.run(until=SHOWN)

    frame = simulation.frame(SHOWN)
    assert frame.count > 0
    for columns in frame.systems.values():
        for column, values in columns.items():
            assert np.isfinite(values).all(), column

    studio = motes.Studio(scene, size=SIZE)
    picture = studio.draw(frame)
    assert np.isfinite(picture.linear).all()
    empty = replace(frame, systems={n: _no_rows(c) for n, c in frame.systems.items()})
    without = studio.draw(empty).pixels.astype(int)
    change = np.abs(picture.pixels - without).max(axis=2)
    assert (change >= VISIBLE).mean() > 1 / 500
    assert (picture.pixels == 255).all(axis=2).mean() <= WHITE


def _no_rows(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: values[:0] for name, values in columns.items()}


@pytest.mark.parametrize("name", ["sprinkler", "fountain"])
def test_the_first_change_that_people_try_works(name: str) -> None:
    scene = motes.load(name).with_values({"water.emit.rate": 2000, "seed": 3})
    assert scene.seed == 3
    assert scene.systems[-1].emit[0].document()["rate"] == 2000
