"""From frames to files: what is written, in which order, and what is left when a run ends early."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from jet import jet

from motes.errors import OutputError, SceneError
from motes.frame import Frame
from motes.production import film, open_frames, redraw
from motes.progress import Progress
from motes.record.frames import FrameStore

av = pytest.importorskip("av")


class Scene(SimpleNamespace):
    """As much of a scene as the film driver looks at."""

    def document(self) -> dict[str, Any]:
        return {"title": "Jet", "seed": self.seed}

    def with_values(self, values: dict[str, Any]) -> Scene:
        return Scene(**{**vars(self), **values})


SCENE = Scene(seed=1, systems=(), film=SimpleNamespace(fps=24.0), light=100)


class Simulation:
    """Twelve frames of a jet; may break off before one of them."""

    frame_count = 12
    breaks_at: int | None = None
    error: type[BaseException] = KeyboardInterrupt
    captures: tuple[()] = ()

    def __init__(self, scene: Scene) -> None:
        self.work = 0

    def frames(self, first: int, last: int) -> Iterator[Frame]:
        for index in range(first, last + 1):
            if index == self.breaks_at:
                raise self.error
            self.work += 10
            yield jet(index, rows=20)


class Studio:
    """Draws every frame as an even grey."""

    def __init__(self, scene: Scene) -> None:
        self.light = scene.light

    def draw(self, frame: Frame) -> Any:
        from PIL import Image

        pixels = np.full((36, 64, 3), self.light, np.uint8)
        return SimpleNamespace(pixels=pixels, save=lambda path: Image.fromarray(pixels).save(path))


@pytest.fixture(autouse=True)
def simulation(monkeypatch: pytest.MonkeyPatch) -> type[Simulation]:
    """The engine replaced by a jet that needs no compiler."""
    parts = {
        "motes.simulation": {"Simulation": type("Jet", (Simulation,), {})},
        "motes.studio": {"Studio": Studio},
        "motes.scene": {"from_document": lambda document, source: SCENE, "drawable": dict},
    }
    for name, content in parts.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return parts["motes.simulation"]["Simulation"]


def pictures(path: Path) -> list[Any]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_a_film_a_sheet_and_all_frames_are_written(tmp_path: Path) -> None:
    made = film(SCENE, tmp_path / "out", name="jet")
    assert made.film == tmp_path / "out" / "jet.mp4"
    assert len(pictures(made.film)) == 12
    assert made.sheet is not None
    assert made.sheet.name == "jet.png"
    assert FrameStore.open(made.frames).numbers() == list(range(1, 13))
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["frames", "jet.mp4", "jet.png"]


def test_progress_counts_frames_and_work(tmp_path: Path) -> None:
    seen: list[Progress] = []
    film(SCENE, tmp_path, watch=seen.append)
    assert [p.done for p in seen] == sorted(p.done for p in seen)
    assert (seen[-1].done, seen[-1].total) == (12, 12)
    assert (seen[-1].particles, seen[-1].particle_steps) == (20, 120)
    first = next(p for p in seen if p.still is not None)
    assert first.done == 0  # The first still is drawn before the frames ahead of it.
    assert first.still == tmp_path / "film.png"


def test_only_some_frames_and_no_picture(tmp_path: Path) -> None:
    made = film(SCENE, tmp_path, first=3, last=5, draw=False)
    assert (made.film, made.sheet) == (None, None)
    assert open_frames(tmp_path).numbers() == [3, 4, 5]
    film(SCENE, tmp_path, first=6, last=7, draw=False)
    assert open_frames(tmp_path).numbers() == [3, 4, 5, 6, 7]


def test_frames_of_another_scene_are_not_mixed_in(tmp_path: Path) -> None:
    film(SCENE, tmp_path, last=5, draw=False)
    film(SCENE.with_values({"seed": 2}), tmp_path, last=2, draw=False)
    assert open_frames(tmp_path).numbers() == [1, 2]


def test_frames_beyond_the_film_are_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no frames 13-20: the film has frames 1-12"):
        film(SCENE, tmp_path, first=13, last=20)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_what_ends_early_keeps_its_frames_and_they_make_a_film(
    tmp_path: Path, simulation: type[Simulation], error: type[BaseException]
) -> None:
    simulation.breaks_at, simulation.error = 8, error
    with pytest.raises(error):
        film(SCENE, tmp_path, name="jet")
    assert open_frames(tmp_path).numbers() == list(range(1, 8))
    assert not list(tmp_path.glob("*.mp4"))
    assert not list(tmp_path.glob(".*"))
    made = redraw(tmp_path)
    assert made.film == tmp_path / "jet.mp4"
    assert len(pictures(made.film)) == 7


def test_frames_are_drawn_again_with_other_values_to_another_place(tmp_path: Path) -> None:
    film(SCENE, tmp_path / "a", draw=False)
    made = redraw(
        tmp_path / "a", values={"light": 200}, output=tmp_path / "b", form="webp", first=2, last=4
    )
    assert made.film == tmp_path / "b" / "film.webp"
    assert made.sheet == tmp_path / "b" / "film.png"
    made = redraw(tmp_path / "a" / "frames", values={"light": 200})
    assert made.film is not None
    assert np.abs(pictures(made.film)[0].astype(int) - 200).max() <= 3


def test_a_full_disk_ends_the_film_with_one_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(store: FrameStore, frame: Frame) -> None:
        if frame.index == 3:
            raise OutputError("cannot write 3: No space left on device.")

    monkeypatch.setattr(FrameStore, "write", write)
    for draw in (True, False):
        with pytest.raises(OutputError, match="No space left"):
            film(SCENE, tmp_path, draw=draw, last=4)
    assert not list(tmp_path.glob("*.mp4"))
