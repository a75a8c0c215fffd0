"""Laws of splats: the light of a particle is kept, wherever and however fast it is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import motes.jit
from motes.renderer import Camera, Film, Layer, Renderer
from motes.renderer.splat import Depths, splat

# From 10 m away, 53.13 degrees: 64 pixels are 10 m high, a pixel is 10/64 m.
CAMERA = Camera(
    position=(0, -10, 0), look_at=(0, 0, 0), field_of_view=float(np.degrees(2 * np.arctan(0.5)))
)
SIZE = 64
PIXEL = 10 / SIZE
FILM = Film(size=(SIZE, SIZE), bloom=0.0)


def particles(x, z, radius, *, y=0.0, velocity=(0, 0, 0), color=(1, 1, 1, 1), **options):
    """Particles given in pixels from the middle of the picture."""
    x, z, y = np.broadcast_arrays(np.atleast_1d(x).astype(float), z, y)
    n = len(x)
    return Layer(
        np.stack([x * PIXEL, y, z * PIXEL], axis=1),
        np.broadcast_to(np.multiply(velocity, PIXEL), (n, 3)),
        np.broadcast_to(np.asarray(color, np.float32), (n, 4)),
        np.broadcast_to(2.0 * np.asarray(radius) * PIXEL, (n,)),
        **options,
    )


def draw(*layers, camera=CAMERA, size=(SIZE, SIZE), **options):
    clear = np.zeros((size[1], size[0], 4), np.float32)
    return splat(layers, camera, clear, shutter=1.0, **options)


@pytest.mark.parametrize("radius", [0.1, 0.7, 1.9, 3.0, 8.0, 20.0])
def test_energy_of_a_splat_does_not_depend_on_its_place(radius):
    """Sum of w over pixels = pi R^2 / 4; within 2 % at the anti-alias floor, less above."""
    energy = [
        draw(particles(a, b, radius))[..., 0].sum()
        for a, b in itertools.product(np.linspace(0, 1, 7), repeat=2)
    ]
    assert np.array(energy) == pytest.approx(
        np.pi * radius**2 / 4, rel=0.02 if radius < 3 else 3e-3
    )


@pytest.mark.parametrize("angle", [0, 17, 45, 80, 90, 200])
@pytest.mark.parametrize("length", [0.01, 0.3, 5.0, 25.0])
def test_energy_of_a_streak_does_not_depend_on_speed_or_direction(length, angle):
    """The time average of a splat has the energy of the splat, pi R^2 / 4."""
    for radius, tolerance in ((0.5, 0.02), (1.9, 0.02), (4.0, 3e-3)):
        way = length * np.array([np.cos(np.radians(angle)), 0, np.sin(np.radians(angle))])
        layer = particles(0.3, 0.6, radius, velocity=way, kind="streaks")
        assert draw(layer)[..., 0].sum() == pytest.approx(np.pi * radius**2 / 4, rel=tolerance)


def test_sum_across_a_streak_is_its_energy_per_length():
    """In the middle of a way of L pixels a line across holds pi R^2 / (4 L)."""
    image = draw(particles(-15, 0.2, 4.0, velocity=(30, 0, 0), kind="streaks"))
    assert image[:, 28:36, 0].sum(axis=0) == pytest.approx(np.pi * 16 / 4 / 30, rel=3e-3)


def test_a_streak_is_the_mean_of_many_still_frames():
    """Mean over 400 instants (midpoint rule) of still splats, each projected anew."""
    velocity = np.array([11.0, 0.0, 7.0])
    instants = (np.arange(400) + 0.5) / 400
    path = instants[:, None] * velocity
    still = draw(particles(path[:, 0], path[:, 2], 2.5, color=(1, 1, 1, 1 / 400)))
    streak = draw(particles(0, 0, 2.5, velocity=velocity, kind="streaks"))
    assert streak[..., 0] == pytest.approx(still[..., 0], abs=2e-4 * float(still.max()))


def test_two_halves_of_the_shutter_are_the_whole():
    """The average over [0, 1] is the sum of those over [0, 0.4] and [0.4, 1], in their measure."""
    shape = {"velocity": (14, 0, -6), "kind": "streaks"}
    whole = draw(particles(0, 0, 2.0, **shape))
    first = draw(particles(0, 0, 2.0, shutter=np.array([[0.0, 0.4]]), **shape))
    second = draw(particles(0, 0, 2.0, shutter=np.array([[0.4, 1.0]]), **shape))
    assert first[..., 0] + second[..., 0] == pytest.approx(whole[..., 0], abs=1e-5)


def test_a_moving_camera_draws_the_streak_of_a_moving_particle():
    """Only relative motion counts: the camera goes left or the particle right."""
    step = 9 * PIXEL
    close = Camera(
        position=(-step, -10, 0), look_at=(-step, 0, 0), field_of_view=CAMERA.field_of_view
    )
    camera = Camera(
        CAMERA.position, CAMERA.look_at, field_of_view=CAMERA.field_of_view, close=close
    )
    carried = draw(particles(0, 0, 2.0, kind="streaks"), camera=camera)
    moved = draw(particles(0, 0, 2.0, velocity=(9, 0, 0), kind="streaks"))
    assert carried == pytest.approx(moved, abs=1e-5)


def test_transmittance_of_a_poisson_slab():
    """n particles per pixel, all random: E[T] = exp(-n sum of alpha), for any kernel."""
    rng = np.random.default_rng(5)
    width, radius, opacity, trials = 512, 2.5, 0.7, 8
    density = 0.12
    values = []
    for _ in range(trials):
        count = rng.poisson(density * width**2)
        x, z = rng.uniform(-width / 2, width / 2, (2, count)) * SIZE / width
        scale = radius * SIZE / width
        layer = particles(x, z, scale, y=0.0, emission=0.0, opacity=opacity)
        image = draw(layer, size=(width, width))
        values.append(1 - image[8:-8:8, 8:-8:8, 3].ravel())  # Farther apart than 2 R.
    values = np.concatenate(values)
    mean = np.exp(-density * opacity * np.pi * radius**2 / 4)
    error = values.std() / np.sqrt(values.size)
    assert abs(values.mean() - mean) < 4 * error
    assert error < 0.005 * mean


def test_layers_are_sorted_by_depth_whatever_their_order():
    """Over operator: C = a1 c1 + (1 - a1)(a2 c2 + (1 - a2) a3 c3), at the centre of the splats."""
    alphas, depths = (0.5, 0.6, 0.7), (0.0, 1.0, 2.0)
    colors = np.eye(3)
    layers = [
        particles(
            0.5 * (10 + y) / 10,
            -0.5 * (10 + y) / 10,
            6.0,
            y=y,
            color=(*color, alpha),
            emission=0.0,
            opacity=1.0,
            kind=kind,
        )
        for color, alpha, y, kind in zip(
            colors, alphas, depths, ("points", "streaks", "sprites"), strict=True
        )
    ]
    expected = (0.5, 0.5 * 0.6, 0.5 * 0.4 * 0.7)
    for order in itertools.permutations(layers):
        assert draw(*order)[32, 32, :3] == pytest.approx(expected, rel=3e-4)


def test_emission_adds_up_in_any_order():
    rng = np.random.default_rng(1)
    place = rng.uniform(-25, 25, (2, 500))
    image = draw(particles(*place, 2.0, y=rng.uniform(-1, 1, 500)))
    single = sum(draw(particles(*place[:, [k]], 2.0))[..., 0].sum() for k in range(0, 500, 50))
    assert image[..., 0].sum() == pytest.approx(500 * single / 10, rel=0.05)
    order = rng.permutation(500)
    layer = particles(*place, 2.0)
    turned = particles(*place[:, order], 2.0)
    assert draw(layer)[..., 0] == pytest.approx(draw(turned)[..., 0], rel=1e-5, abs=1e-6)


def test_a_picture_does_not_depend_on_the_number_of_threads():
    rng = np.random.default_rng(2)
    n = 40_000
    layers = [
        particles(
            *rng.uniform(-40, 40, (2, n)),
            rng.uniform(0.3, 4, n),
            y=rng.uniform(-3, 3, n),
            velocity=(5, 3, 2),
            color=(0.5, 0.7, 0.9, 0.3),
            opacity=0.5,
            kind=kind,
        )
        for kind in ("streaks", "points")
    ]
    before = motes.jit.threads()
    try:
        images = []
        for count in (1, 2, 4):
            motes.jit.threads(count)
            images.append(draw(*layers, size=(160, 90)))
    finally:
        motes.jit.threads(before)
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


@pytest.mark.parametrize("kind", ["sprites", "streaks"])
@pytest.mark.parametrize("border", [-3.25, 0.0, 1.5])
def test_a_half_plane_hides_its_part_of_a_splat(kind, border):
    """Seen left of the border x: the integral of w up to there, within an eighth of a column."""
    radius = 6.0
    columns = np.arange(SIZE) - SIZE / 2
    depth = np.full((SIZE, SIZE), np.inf, np.float32)
    depth[:, columns >= border] = 5.0
    edge = np.full((SIZE, SIZE), -1, np.int32)
    samples = np.full((1, 4), np.inf, np.float32)
    whole = (border - columns[columns < border][-1]) % 1.0
    if whole:
        edge[:, np.flatnonzero(columns < border)[-1]] = 0
        samples[0, round(4 * whole) :] = 5.0
    layer = particles(0, 0, radius, kind=kind)
    free = draw(layer)[..., 0]
    seen = draw(layer, depths=Depths(depth, edge, samples))[..., 0]
    part = np.clip(border - columns, 0, 1)
    column = free.sum(axis=0)
    assert seen.sum() == pytest.approx((column * part).sum(), abs=float(column.max()) / 8)
    assert seen[:, columns >= border].max() == 0
    left = columns < border - 1
    assert seen[:, left] == pytest.approx(free[:, left], abs=3e-4)


def test_a_soft_particle_fades_in_front_of_a_solid():
    """V = (z_solid - z) / softness, between 0 and 1."""
    edge = np.full((SIZE, SIZE), -1, np.int32)
    samples = np.empty((0, 4), np.float32)
    layer = particles(0, 0, 6.0, kind="sprites", softness=2.0)
    free = draw(layer)
    for distance in (9.0, 10.5, 11.0, 12.5):
        depth = np.full((SIZE, SIZE), distance, np.float32)
        seen = draw(layer, depths=Depths(depth, edge, samples))
        visible = np.clip((distance - 10) / 2, 0, 1)
        assert seen[..., 0] == pytest.approx(visible * free[..., 0], abs=3e-4)


def test_flux_falls_with_the_square_of_distance_and_radiance_stays():
    """A point sends a quarter at twice the distance; a resolved disc keeps its peak."""
    layer = particles(0, 0, 0.3)
    near, far = (
        draw(layer, camera=Camera((0, -d, 0), (0, 0, 0), field_of_view=30))[..., 0].sum()
        for d in (10, 20)
    )
    assert near / far == pytest.approx(4, rel=0.03)
    disc = particles(0, 0, 12.0)
    near, far = (
        draw(disc, camera=Camera((0, -d, 0), (0, 0, 0), field_of_view=60))[..., 0].max()
        for d in (10, 20)
    )
    assert near == pytest.approx(far, rel=0.05)


def test_bad_particles_are_left_out_and_the_good_one_is_drawn():
    good = draw(particles(3, 4, 2.0))
    nan, inf = np.nan, np.inf
    for x, z, radius, y in (
        (nan, 0, 2, 0),
        (inf, 0, 2, 0),
        (0, 0, nan, 0),
        (0, 0, 0, 0),
        (0, 0, -1, 0),
        (0, 0, 2, -11),
        (0, 0, 2, -10),
        (1e30, 1e30, 2, 0),
        (0, 0, inf, 0),
    ):
        for kind in ("points", "streaks"):
            bad = particles(x, z, radius, y=y, velocity=(1, 0, 3), kind=kind)
            assert np.array_equal(draw(bad, particles(3, 4, 2.0)), good), (x, z, radius, y)


def test_extreme_sizes_of_picture_and_particle():
    for size in ((1, 1), (33, 1), (1, 70)):
        assert draw(particles(0, 0, 2.0), size=size).shape == (size[1], size[0], 4)
    assert draw(particles(np.empty(0), 0.0, 1.0)).max() == 0
    huge = draw(particles(0, 0, 1e6, emission=0.5))
    assert huge[..., 0] == pytest.approx(0.5, rel=1e-3)
    passing = particles(0, 0, 2.0, y=-10.5, velocity=(0, 900, 1), kind="streaks")
    assert np.isfinite(draw(passing)).all()


def test_slabs_of_depth_give_the_picture_of_one_piece(monkeypatch):
    rng = np.random.default_rng(3)
    layer = particles(
        *rng.uniform(-30, 30, (2, 300)), 40.0, y=rng.uniform(-3, 3, 300), emission=0.1, opacity=0.2
    )
    whole = draw(layer, size=(128, 128))
    monkeypatch.setattr("motes.renderer.splat.PACKED_BYTES", 20_000)
    # Up to what the early end of an opaque tile leaves out.
    assert draw(layer, size=(128, 128)) == pytest.approx(whole, abs=2 / 4096)


def test_a_clear_picture_keeps_its_alpha():
    picture = Renderer(FILM).draw([particles(0.5, -0.5, 8.0, opacity=0.5, emission=0)], CAMERA)
    assert picture.linear[32, 32, 3] == pytest.approx(0.5, abs=1e-3)
    assert picture.linear[0, 0].max() == 0
    assert picture.pixels.shape == (SIZE, SIZE, 3)


def test_a_trail_shows_the_way_since_birth():
    """From x - v min(trail, age) to x + v shutter, its light in proportion to that time."""

    def line(age):
        layer = particles(
            0, 0, 1.9, velocity=(6, 0, 0), kind="streaks", trail=3.0, age=np.full(1, age)
        )
        return draw(layer)[..., 0].sum(axis=0)

    old, young = line(9.0), line(1.0)
    x = np.arange(SIZE) + 0.5 - SIZE / 2
    assert (x * old).sum() / old.sum() == pytest.approx(-6.0, abs=0.1)
    assert (x * young).sum() / young.sum() == pytest.approx(0.0, abs=0.1)
    assert young.sum() == pytest.approx(0.5 * old.sum(), rel=0.02)
