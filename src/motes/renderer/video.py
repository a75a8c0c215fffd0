"""Films and contact sheets."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.files import finished, written_whole
from motes.renderer.picture import PNG_LEVEL

Pixels = NDArray[np.uint8]

_X264 = {"crf": "19", "preset": "superfast", "x264-params": "sliced-threads=0:bframes=0"}

_CODECS: dict[str, tuple[str, str, str, dict[str, str]]] = {
    # suffix: container, codec, pixel format, settings. The settings, the number of threads
    # included, are fixed so that the same frames give the same file. Frames that point ahead cost
    # a film of drifting points a fifth of its time and save it a sixtieth of its size.
    ".mp4": ("mp4", "libx264", "yuv420p", _X264),
    ".webp": ("webp", "libwebp_anim", "yuv420p", {"quality": "85", "compression_level": "2"}),
}


class Video:
    """A film file that appears under its name when it is closed whole, or not at all.

    Used as a context manager: leaving it by an exception leaves no file.

    Raises:
        ValueError: the suffix is not .mp4, .webp or .gif, or a frame differs in size.
    """

    def __init__(self, path: str | Path, *, fps: float | Fraction = 24) -> None:
        self.path = Path(path)
        self._suffix = self.path.suffix.lower()
        if self._suffix not in (*_CODECS, ".gif"):
            raise ValueError(f"{self.path.name}: a film is saved as .mp4, .webp or .gif")
        self._rate = Fraction(fps).limit_denominator(1001)
        if self._rate <= 0:
            raise ValueError(f"fps must be above 0, not {fps}")
        self._whole = finished(self.path)
        self._size: tuple[int, int] | None = None
        self._container: Any = None
        self._stream: Any = None
        self._stills: list[Any] = []
        self.frames = 0

    def __enter__(self) -> Video:
        self._part = self._whole.__enter__()
        return self

    def write(self, pixels: Pixels) -> None:
        """Append one frame (h, w, 3); an .mp4 repeats the last row and column of odd sizes."""
        height, width = pixels.shape[:2]
        if self._size is None:
            self._size = (width, height)
            self._open()
        if self._size != (width, height):
            raise ValueError(f"a frame of {width} x {height} in a film of {self._size}")
        if self._container is None:
            from PIL import Image

            self._stills.append(Image.fromarray(pixels).quantize(256))
        else:
            self._encode(pixels)
        self.frames += 1

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None and self.frames == 0:
            kind, error = ValueError, ValueError(f"{self.path.name}: a film needs a frame")
            self._whole.__exit__(kind, error, None)
            raise error
        try:
            if kind is None:
                self._finish()
        except BaseException as fault:
            kind, error, trace = type(fault), fault, fault.__traceback__
            raise
        finally:
            if self._container is not None:
                self._container.close()
            self._whole.__exit__(kind, error, trace)

    def _open(self) -> None:
        if self._suffix == ".gif" or self._size is None:
            return
        import av

        form, codec, pixel_format, settings = _CODECS[self._suffix]
        options = {"movflags": "+faststart"} if form == "mp4" else {"loop": "0"}
        options["fflags"] = "+bitexact"
        self._container = av.open(str(self._part), "w", format=form, options=options)
        self._stream = self._container.add_stream(codec, rate=self._rate, options=settings)
        self._stream.width, self._stream.height = self._padded(*self._size)
        self._stream.pix_fmt = pixel_format
        self._stream.codec_context.thread_count = 2
        if form == "mp4":
            # Say that the colours are BT.709 in the narrow range, or players guess.
            context = self._stream.codec_context
            context.colorspace, context.color_range = 1, 1
            context.color_primaries, context.color_trc = 1, 1

    def _padded(self, width: int, height: int) -> tuple[int, int]:
        """Size of the encoded frame: chroma at half resolution needs even numbers."""
        if self._suffix == ".mp4":
            return max(width + width % 2, 2), max(height + height % 2, 2)
        return width, height

    def _encode(self, pixels: Pixels) -> None:
        import av
        from av.video.reformatter import ColorRange, Colorspace

        height, width = pixels.shape[:2]
        wide, high = self._padded(width, height)
        if (wide, high) != (width, height):
            pixels = np.pad(pixels, ((0, high - height), (0, wide - width), (0, 0)), "edge")
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
        matrix = Colorspace.ITU709 if self._suffix == ".mp4" else Colorspace.ITU601
        frame = frame.reformat(
            format=self._stream.pix_fmt,
            dst_colorspace=matrix,
            src_color_range=ColorRange.JPEG,
            dst_color_range=ColorRange.MPEG,
        )
        frame.pts = self.frames
        frame.time_base = 1 / self._rate
        self._container.mux(self._stream.encode(frame))

    def _finish(self) -> None:
        if self._container is not None:
            self._container.mux(self._stream.encode(None))
            self._container.close()
            return
        first, *rest = self._stills
        first.save(
            self._part,
            "GIF",
            save_all=True,
            append_images=rest,
            duration=round(1000 / self._rate),
            loop=0,
        )


def contact_sheet(
    stills: Sequence[Pixels], times: Sequence[float], path: str | Path, *, columns: int = 3
) -> None:
    """Write stills (h, w, 3) of equal size, each labelled with its time [s], as one .png."""
    from PIL import Image, ImageDraw, ImageFont

    if not stills or len(stills) != len(times):
        raise ValueError(f"{len(stills)} stills and {len(times)} times; each needs the other")
    height, width = stills[0].shape[:2]
    tall, wide = max(height * 640 // width, 1), 640
    gap, label = 12, 28
    columns = min(columns, len(stills))
    rows = -(-len(stills) // columns)
    size = (gap + columns * (wide + gap), gap + rows * (tall + label + gap))
    sheet = Image.new("RGB", size, (18, 18, 20))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(16)
    for number, (still, time) in enumerate(zip(stills, times, strict=True)):
        left = gap + number % columns * (wide + gap)
        top = gap + number // columns * (tall + label + gap)
        sheet.paste(
            Image.fromarray(still).resize((wide, tall), Image.Resampling.LANCZOS), (left, top)
        )
        draw.text((left + 2, top + tall + 5), f"t = {time:.2f} s", fill=(190, 190, 195), font=font)
    with written_whole(Path(path)) as file:
        sheet.save(file, "PNG", compress_level=PNG_LEVEL)
