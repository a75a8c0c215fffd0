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

PNG_LEVEL = 3
"""How hard PNG files are packed: 6, the usual, takes three times as long for the same size."""


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

        Where nothing is behind the particles, .png and .webp have an alpha channel.

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

                clear = suffix in (".png", ".webp") and bool((self.linear[..., 3] < 1 / 512).any())
                pixels = self._with_alpha() if clear else self.pixels
                image = Image.fromarray(pixels)
                image.save(file, formats[suffix], quality=92, compress_level=PNG_LEVEL)

    def _with_alpha(self) -> NDArray[np.uint8]:
        """Straight red, green, blue and alpha that give `pixels` over black.

        Light that covers nothing still needs some alpha to be seen: as much as it is bright.
        """
        shown = self.pixels.astype(np.float32) / 255
        alpha = np.maximum(np.clip(self.linear[..., 3], 0, 1), shown.max(axis=2))
        straight = shown / np.maximum(alpha, 1 / 255)[..., None]
        whole = np.concatenate([straight, alpha[..., None]], axis=2)
        rounded: NDArray[np.uint8] = np.rint(255 * np.clip(whole, 0, 1)).astype(np.uint8)
        return rounded
