"""Laws of film: glow keeps the light, tone maps keep greys and order, dither keeps the mean."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from PIL import Image

from motes.renderer import Film, Picture, Video, contact_sheet
from motes.renderer.bloom import bloom
from motes.renderer.film import ToneMap
from motes.renderer.tone import develop

TONES = get_args(ToneMap)


def grey(light: np.ndarray) -> np.ndarray:
    """A row of grey pixels of the given light."""
    return np.repeat(np.asarray(light, np.float32)[None, :, None], 4, axis=2)


@pytest.mark.parametrize("size", [(128, 128), (97, 101)])
def test_bloom_keeps_the_light(size):
    """Sum I' = Sum I where nothing reaches the border, and the glow falls with distance."""
    image = np.zeros((*size, 4), np.float32)
    image[size[0] // 2, size[1] // 2, :3] = 100.0
    bloom(image, Film(bloom=0.3, bloom_radius=3))
    assert image[..., 0].sum() == pytest.approx(100, rel=1e-3)
    assert image[size[0] // 2, size[1] // 2, 0] > 70
    line = image[size[0] // 2, size[1] // 2 :, 0]
    assert line[1] > line[4] > line[8] > 0


def test_no_bloom_changes_nothing():
    image = np.random.default_rng(0).random((20, 30, 4), np.float32)
    kept = image.copy()
    bloom(image, Film(bloom=0.0))
    assert np.array_equal(image, kept)


@pytest.mark.parametrize("tone", TONES)
def test_tone_maps_are_monotone_and_neutral(tone):
    light = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 4000)])
    pixels = develop(grey(light), Film(tone=tone, dither=False))[0].astype(int)
    assert np.ptp(pixels, axis=1).max() <= 1
    assert np.diff(pixels[:, 1]).min() >= 0
    assert pixels[0].max() == 0
    assert pixels[-1].min() == 255


def test_srgb_is_the_standard_encoding():
    """IEC 61966-2-1: 0.5 is code 188; an exposure of -1 EV halves the light before it."""
    film = Film(tone="srgb", dither=False)
    assert develop(grey([0.5]), film)[0, 0, 0] == 188
    assert develop(grey([1.0]), Film(tone="srgb", dither=False, exposure=-1))[0, 0, 0] == 188


def test_agx_keeps_middle_grey_in_the_middle_and_takes_bright_colour_to_white():
    film = Film(dither=False)
    assert develop(grey([0.18]), film)[0, 0, 0] == pytest.approx(128, abs=2)
    bright = np.array([[[400.0, 40.0, 4.0, 1.0]]], np.float32)
    assert develop(bright, film)[0, 0].min() > 150
    assert develop(bright / 400, film)[0, 0, 2] < 120


def test_dither_keeps_the_mean():
    """Mean code of an even grey between two codes = that grey, within 0.02 of a step."""
    code = 100.3 / 255
    light = ((code + 0.055) / 1.055) ** 2.4
    field = np.full((256, 256, 4), light, np.float32)
    pixels = develop(field, Film(tone="srgb"))
    assert pixels.mean() == pytest.approx(100.3, abs=0.02)
    assert set(np.unique(pixels)) == {100, 101}


def test_light_that_is_no_number_is_black_and_infinite_light_white():
    pixels = develop(grey([np.nan, -1.0, np.inf]), Film(dither=False))[0]
    assert pixels[:2].max() == 0
    assert pixels[2].min() == 255


def test_pictures_read_back(tmp_path):
    linear = np.random.default_rng(1).random((9, 14, 4), np.float32)
    picture = Picture(linear, Film(size=(14, 9)))
    for suffix in ("png", "webp", "jpg", "npy"):
        picture.save(tmp_path / f"picture.{suffix}")
    assert np.array_equal(np.load(tmp_path / "picture.npy"), linear)
    with Image.open(tmp_path / "picture.png") as image:
        assert np.array_equal(np.asarray(image), picture.pixels)
    with pytest.raises(ValueError, match=r"\.png"):
        picture.save(tmp_path / "picture.tga")


def frames(count, size=(96, 64)):
    """A bright square that walks over a gradient."""
    y, x = np.mgrid[: size[1], : size[0]]
    for number in range(count):
        frame = np.stack([x * 2, y * 3, x + y], axis=2).astype(np.uint8)
        frame[20:40, 10 + 4 * number : 30 + 4 * number] = (250, 120, 20)
        yield frame


def write(path, film):
    with Video(path, fps=24) as video:
        for frame in film:
            video.write(frame)


def test_mp4_reads_back(tmp_path):
    """The number of frames, their size and rate are kept, and colours within 6 codes."""
    import av

    path = tmp_path / "film.mp4"
    files = []
    for _ in range(2):
        write(path, frames(12))
        files.append(path.read_bytes())
    assert files[0] == files[1]
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert stream.average_rate == 24
        decoded = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
    assert len(decoded) == 12
    for seen, frame in zip(decoded, frames(12), strict=True):
        assert seen.shape == frame.shape
        assert seen[22:38, :8].astype(int) == pytest.approx(frame[22:38, :8].astype(int), abs=9)


@pytest.mark.parametrize("suffix", ["webp", "gif"])
def test_animated_images_read_back(tmp_path, suffix):
    with Video(tmp_path / f"film.{suffix}", fps=20) as video:
        for frame in frames(5):
            video.write(frame)
    with Image.open(tmp_path / f"film.{suffix}") as image:
        assert image.n_frames == 5
        assert image.size == (96, 64)
        image.seek(2)
        image.load()
        assert image.info["duration"] == 50


def test_odd_sizes_and_single_pixels_become_a_film(tmp_path):
    for size in ((1, 1), (33, 17)):
        with Video(tmp_path / "odd.mp4") as video:
            video.write(np.full((size[1], size[0], 3), 90, np.uint8))
        assert (tmp_path / "odd.mp4").stat().st_size > 500


def test_a_film_that_fails_leaves_no_file(tmp_path):
    other_size = np.zeros((40, 40, 3), np.uint8)
    with pytest.raises(ValueError, match="40 x 40"):
        write(tmp_path / "film.mp4", [*frames(3), other_size])
    with pytest.raises(ValueError, match="needs a frame"), Video(tmp_path / "empty.mp4"):
        pass
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match=r"\.mp4"):
        Video(tmp_path / "film.avi")


def test_a_contact_sheet_holds_all_stills(tmp_path):
    stills = list(frames(6))
    contact_sheet(stills, [0.5 * k for k in range(6)], tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as image:
        assert image.size[0] > 3 * 640
        assert image.size[1] > 2 * 420


def test_a_still_without_backdrop_keeps_its_transparency(tmp_path):
    """Over black, the straight colours and alpha of the file give the picture's pixels."""
    from PIL import Image

    linear = np.zeros((4, 4, 4), np.float32)
    linear[0, 0] = (0.2, 0.1, 0.05, 0.5)
    linear[1, 1] = (0.3, 0.0, 0.0, 0.0)
    picture = Picture(linear, Film(size=(4, 4), bloom=0.0, dither=False))
    picture.save(tmp_path / "clear.png")
    read = np.asarray(Image.open(tmp_path / "clear.png")).astype(float)
    assert read.shape == (4, 4, 4)
    over_black = read[..., :3] * read[..., 3:] / 255
    assert np.abs(over_black - picture.pixels).max() <= 1
    assert read[0, 0, 3] >= 127
    assert read[3, 3, 3] == picture.pixels[3, 3].max()
