"""A finished frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motes.files import written_whole
from motes.renderer.film import Film
from motes.renderer.tone import develop


@dataclass(frozen=True, eq=False)
class Picture:
    """Light on film."""

    linear: NDArray[np.float32]
    """(h, w, 4) linear light, premultiplied, and its alpha, the part of the pixel covered."""

    film: Film
    """How the light becomes `pixels`."""

    @cached_property
    def pixels(self) -> NDArray[np.uint8]:
        """Display values (h, w, 3) after exposure, tone map and dither, over black."""
        return develop(self.linear, self.film)

    def save(self, path: str | Path) -> None:
        """Write as .png, .webp or .jpg, or the linear light as .npy; all of the file or nothing.

        Raises:
            ValueError: the suffix is none of these.
        """
        path = Path(path)
        formats = {".png": "PNG", ".webp": "WEBP", ".jpg": "JPEG", ".jpeg": "JPEG", ".npy": ""}
        suffix = path.suffix.lower()
        if suffix not in formats:
            raise ValueError(f"{path.name}: a picture is saved as .png, .webp, .jpg or .npy")
        with written_whole(path) as file:
            if suffix == ".npy":
                np.save(file, self.linear)
            else:
                from PIL import Image

                Image.fromarray(self.pixels).save(file, formats[suffix], quality=92)
