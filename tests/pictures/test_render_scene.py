"""A fountain, smoke and sparks around a ball on a lawn: what an eye would complain about."""

from __future__ import annotations

import numpy as np
import pytest

from motes.jit import jit
from motes.renderer import Camera, Film, Layer, Renderer, Sky, Solids, Stars, Sun

SIZE = (320, 180)
CAMERA = Camera(position=(0.3, -6.5, 1.7), look_at=(0.0, 0.0, 1.1))
NIGHT = Sky(
    zenith=(0.004, 0.006, 0.014),
    horizon=(0.02, 0.022, 0.035),
    ground=(0.01, 0.01, 0.012),
    sun=Sun(color=(0.06, 0.07, 0.1), glow=0.05),
    stars=Stars(),
)


@jit(inline=True)
def ball_on_lawn(p, x, y, z):
    dx, dy, dz = x - p[0], y - p[1], z - p[2]
    ball = np.sqrt(dx * dx + dy * dy + dz * dz) - p[3]
    return (ball, 1) if ball < z else (z, 0)


DARK = Sky.plain((0.0, 0.0, 0.0))
SOLIDS = Solids(
    ball_on_lawn,
    np.array([0.15, 0.9, 0.7, 0.7], np.float32),
    np.array([[0.3] * 3, [0.7, 0.2, 0.1]]),
)


def smoke(n=1500):
    rng = np.random.default_rng(1)
    height = rng.random(n) ** 0.7
    radius, angle = (0.12 + 0.55 * height) * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    x, y = radius * np.cos(angle) - 0.9, radius * np.sin(angle) + 0.2
    position = np.stack([x, y, 0.05 + 3 * height], axis=1)
    color = np.stack([0.8 + 0 * x, 0.78 + 0 * x, 0.76 + 0 * x, 0.3 * (1 - height) ** 0.6], axis=1)
    return Layer(
        position,
        0 * position,
        color,
        0.15 + 0.5 * height,
        kind="sprites",
        emission=0.0,
        opacity=1.0,
        softness=0.3,
    )


def sparks(n=1500):
    rng = np.random.default_rng(3)
    way = rng.normal(size=(n, 3))
    way[:, 2] = np.abs(way[:, 2])
    start = way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(2, 5, n)[:, None]
    t = rng.uniform(0.05, 0.3, n)[:, None]
    gravity = np.array([0, 0, -9.81])
    position = np.array([0, -1.2, 0.3]) + start * t + gravity * t * t / 2
    color = np.tile([1.0, 0.42, 0.1, 1.0], (n, 1))
    velocity = start + gravity * t
    return Layer(position, velocity, color, np.full(n, 0.012), kind="streaks", emission=6.0)


@pytest.mark.parametrize("sky", [Sky(), NIGHT], ids=["day", "night"])
def test_light_is_finite_positive_and_seldom_clipped(sky):
    picture = Renderer(Film(size=SIZE)).draw(
        [smoke(), sparks()], CAMERA, shutter=1 / 48, sky=sky, solids=SOLIDS
    )
    assert np.isfinite(picture.linear).all()
    assert picture.linear.min() >= 0
    assert picture.linear[..., 3] == pytest.approx(1, abs=1e-4)
    assert (picture.pixels.min(axis=2) == 255).mean() < 0.005
    assert picture.pixels.max() > (150 if sky is NIGHT else 190)


def test_sparks_stay_warm_and_smoke_stays_grey():
    renderer = Renderer(Film(size=SIZE))
    bare = renderer.draw([], CAMERA, sky=NIGHT, solids=SOLIDS).pixels.astype(int)
    lit = renderer.draw([sparks()], CAMERA, shutter=1 / 48, sky=NIGHT, solids=SOLIDS).pixels
    red, green, blue = np.moveaxis(lit[(lit - bare).max(axis=2) > 90].astype(float), -1, 0)
    assert red.size > 100
    assert red.mean() > 1.2 * green.mean()
    assert green.mean() > 1.2 * blue.mean()
    day = renderer.draw([smoke()], CAMERA, sky=Sky(), solids=SOLIDS).pixels[30:90, 115:150]
    assert np.ptp(day.reshape(-1, 3).mean(axis=0)) < 25


def test_smoke_meets_the_ball_without_a_cut():
    """Where soft smoke enters a solid the light changes no faster than within the smoke."""
    renderer = Renderer(Film(size=SIZE, bloom=0.0))
    black = Solids(ball_on_lawn, SOLIDS.params, np.zeros((2, 3)))
    one = np.array([[0.15, 0.3, 0.7]])

    def roughness(softness):
        color = np.ones((1, 4))
        puff = Layer(
            one, 0 * one, color, np.full(1, 2.0), kind="sprites", emission=1.0, softness=softness
        )
        return renderer.draw([puff], CAMERA, sky=DARK, solids=black).linear[..., 0]

    hard, soft = roughness(0.0), roughness(0.6)
    assert soft.max() > 0.1
    assert np.abs(np.diff(soft)).max() / soft.max() < 0.8 * np.abs(np.diff(hard)).max() / hard.max()


def test_a_still_scene_does_not_flicker():
    """The same frame twice is the same; a camera moved by a hundredth of a pixel nearly so."""
    renderer = Renderer(Film(size=SIZE))
    first, second = (
        renderer.draw([sparks()], CAMERA, shutter=1 / 48, sky=NIGHT, solids=SOLIDS)
        for _ in range(2)
    )
    assert np.array_equal(first.pixels, second.pixels)
    step = 0.01 * 6.5 / CAMERA.focal(SIZE[1])
    moved = Camera(position=(0.3 + step, -6.5, 1.7), look_at=(step, 0.0, 1.1))
    third = renderer.draw([sparks()], moved, shutter=1 / 48, sky=NIGHT, solids=SOLIDS)
    total = first.linear[..., :3].sum()
    assert third.linear[..., :3].sum() == pytest.approx(total, rel=5e-3)
