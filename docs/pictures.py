"""Draw docs/pictures: a still of every scene of the gallery, small enough for a page.

python docs/pictures.py               all scenes that have none
python docs/pictures.py snow circle   these, again
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

from PIL import Image

import motes
from motes.scene import gallery

FOLDER = Path(__file__).resolve().parent / "pictures"

SIZE = (640, 360)
LARGEST = 60_000
"""Bytes of one picture."""

INSTANT = 0.6
"""Share of the film at which a still is taken."""

INSTANTS = {
    "battle": 0.8,
    "cluster": 0.13,
    "evacuation": 0.3,
    "fireworks": 0.75,
    "fountain": 0.9,
    "galaxy_collision": 0.42,
    "granular": 0.65,
    "lj_melting": 0.3,
    "lj_splash": 0.67,
    "plummer": 0.1,
    "ring": 0.5,
    "solar_system": 0.35,
}
"""Shares for scenes that are better seen at another time."""


def still(name: str) -> Image.Image:
    """The picture of a scene at its instant, drawn in twice the size and reduced."""
    width, height = SIZE
    scene = motes.load(name).with_values({"film.size": [2 * width, 2 * height]})
    simulation = motes.Simulation(scene)
    last = simulation.frame_count
    number = max(1, round(INSTANTS.get(name, INSTANT) * last))
    (frame,) = simulation.frames(first=number, last=number)
    picture = motes.render(frame, scene)
    return Image.fromarray(picture.pixels).resize(SIZE, Image.Resampling.LANCZOS)


def packed(image: Image.Image) -> bytes:
    """The picture as WebP, at the best quality that is small enough."""
    for quality in range(88, 20, -4):
        file = BytesIO()
        image.save(file, "WEBP", quality=quality, method=6)
        if file.tell() <= LARGEST:
            break
    return file.getvalue()


def main(names: list[str]) -> None:
    """Draw the named scenes, or those without a picture."""
    FOLDER.mkdir(exist_ok=True)
    paths = {name: FOLDER / f"{name}.webp" for name in names or gallery()}
    for name, path in paths.items():
        if names or not path.exists():
            path.write_bytes(packed(still(name)))
            print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
