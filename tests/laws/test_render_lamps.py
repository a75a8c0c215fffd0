"""Laws of the light that particles throw: inverse squares, cosines, and its sum."""

from __future__ import annotations

import numpy as np
import pytest

import motes.jit
from motes.renderer import Camera, Film, Layer, Renderer, Sky, Solids
from motes.renderer.lamps import gather, scattered

DARK = Sky(*[(0.0, 0.0, 0.0)] * 3, sun=None, haze=1e6)
ORANGE = np.array([1.0, 0.5, 0.1])


def glow(center=(0.0, 0.0, 2.0), n=200, spread=0.0, emission=3.0, size=0.05):
    """Particles that shine around a point."""
    position = np.array(center) + spread * np.random.default_rng(0).normal(size=(n, 3))
    color = np.tile([*ORANGE, 0.5], (n, 1))
    return Layer(position, 0 * position, color, np.full(n, size), emission=emission)


def strength(layer):
    """Sum of radiance times s^2 / 16."""
    return layer.emission * 0.5 * ORANGE * (layer.size.astype(float) ** 2).sum() / 16


def test_a_splat_sends_out_what_its_picture_shows():
    """Its flux is the integral of its radiance: L integral (1 - r^2/R^2)^3 dA = L pi s^2 / 16.

    A white surface that faces the flux at distance d gives off 1/pi of it over d^2.
    """
    layer = glow(n=1, size=0.5)
    radius = 0.25
    r = np.linspace(0, radius, 10001)
    flux = np.trapezoid((1 - (r / radius) ** 2) ** 3 * 2 * np.pi * r, r)
    lamps = gather([layer], 0.0)
    assert lamps[0, 4:] == pytest.approx(flux / np.pi * 1.5 * ORANGE, rel=1e-4)


def test_the_ground_is_lit_by_the_cosine_over_the_squared_distance():
    """Below a small fire at height H: color g H / (x^2 + H^2)^(3/2)."""
    camera = Camera(position=(0, 0, 10), look_at=(0, 0, 0), up=(0, 1, 0), field_of_view=40)
    ground = Solids(None, np.empty(0), np.full((1, 3), 0.4), np.array([[0, 0, 1, 0.0]]))
    layer = glow(center=(0, 0, 2), size=1e-3, emission=1e7)
    renderer = Renderer(Film(size=(65, 65), bloom=0.0))
    image = renderer.draw([layer], camera, sky=DARK, solids=ground).linear[..., :3]
    column = np.array([8, 16, 56])
    x = (column + 0.5 - 32.5) * 10 / camera.focal(65)
    expected = 0.4 * strength(layer) * (2 / (x * x + 4) ** 1.5)[:, None]
    assert image[32, column] == pytest.approx(expected, rel=1e-3)


def test_lamps_give_all_the_light_of_a_cloud():
    """Far away, a cloud is a point: matter there scatters half of g / d^2."""
    layer = glow(center=(0, 0, 0), n=5000, spread=0.3)
    lamps = gather([layer], 0.0)
    assert len(lamps) == 8
    assert lamps[:, 4:].sum(axis=0) == pytest.approx(strength(layer), rel=1e-5)
    far = scattered(np.array([[0, 40.0, 0]], np.float32), lamps)[0]
    assert far == pytest.approx(strength(layer) / 2 / 40**2, rel=0.01)


def test_smoke_over_a_fire_is_warm_and_no_light_is_no_lamp():
    smoke = Layer(
        np.array([[0, 0, 3.0]]), np.zeros((1, 3)), np.ones((1, 4)), np.ones(1), opacity=1.0,
        emission=0.0, kind="sprites",
    )  # fmt: skip
    camera = Camera(position=(0, -8, 3), look_at=(0, 0, 3))
    renderer = Renderer(Film(size=(65, 65), bloom=0.0))
    alone = renderer.draw([smoke], camera, sky=DARK).linear
    assert alone[..., :3].max() == 0
    warm = renderer.draw([smoke, glow(center=(0, 0, 0))], camera, sky=DARK).linear[32, 32]
    assert warm[:3] == pytest.approx(strength(glow()) / 2 / 9, rel=0.02)
    assert len(gather([smoke], 1.0)) == 0
    assert len(gather([glow(n=1, size=1e-4, spread=1.0, center=(5, 0, 0))], 1e9)) == 0


def test_lamps_do_not_depend_on_threads():
    ground = Solids(None, np.empty(0), np.full((1, 3), 0.4), np.array([[0, 0, 1, 0.0]]))
    images = []
    for count in (1, 2, 4):
        motes.jit.threads(count)
        renderer = Renderer(Film(size=(300, 200)))
        images.append(renderer.draw([glow(spread=0.5)], Camera(), sky=DARK, solids=ground).linear)
    motes.jit.threads(0)
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_a_lone_particle_does_not_blind_itself() -> None:
    """At its own place its light is at most half of g / r^2 = L / 4, with r its radius."""
    alone = Layer(
        position=np.zeros((1, 3), np.float32),
        velocity=np.zeros((1, 3), np.float32),
        color=np.ones((1, 4), np.float32),
        size=np.array([0.01], np.float32),
        emission=3.0,
        opacity=0.5,
    )
    light = scattered(alone.position, gather([alone], 0.0))
    assert light == pytest.approx(np.full((1, 3), 3.0 / 8), rel=1e-4)
