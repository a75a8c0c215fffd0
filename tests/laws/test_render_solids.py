"""Laws of the backdrop: solids are where their distance function says, and lit by the sky."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motes.jit import jit
from motes.renderer import Camera, Film, Renderer, Sky, Solids, Stars, Sun
from motes.renderer.backdrop import backdrop

SIZE = (96, 64)
CAMERA = Camera(position=(0, -8, 2), look_at=(0, 0, 1), field_of_view=40)
ONE, ZERO = np.float32(1), np.float32(0)


@jit(inline=True)
def plane_sphere_box(p, x, y, z):
    """The ground z = 0, a sphere (center, radius) and a box (center, half width)."""
    distance, index = z, 0
    dx, dy, dz = x - p[0], y - p[1], z - p[2]
    sphere = np.sqrt(dx * dx + dy * dy + dz * dz) - p[3]
    if sphere < distance:
        distance, index = sphere, 1
    dx, dy, dz = abs(x - p[4]) - p[7], abs(y - p[5]) - p[7], abs(z - p[6]) - p[7]
    outside_x, outside_y, outside_z = max(dx, ZERO), max(dy, ZERO), max(dz, ZERO)
    box = np.sqrt(outside_x * outside_x + outside_y * outside_y + outside_z * outside_z)
    box += min(max(dx, max(dy, dz)), ZERO)
    if box < distance:
        distance, index = box, 2
    return distance, index


PARAMS = np.array([-1, 0, 1, 1, 1.5, 0.5, 0.5, 0.5], np.float32)
COLORS = np.array([[0.3, 0.3, 0.3], [0.7, 0.2, 0.1], [0.1, 0.3, 0.7]], np.float32)
SOLIDS = Solids(plane_sphere_box, PARAMS, COLORS)


def exact_depths():
    """Nearest positive root along each ray: of the plane z = 0 and of the sphere, as depth."""
    y, x = np.divmod(np.arange(SIZE[0] * SIZE[1]), SIZE[0])
    rays = CAMERA.rays(x + 0.5, y + 0.5, SIZE).astype(float)
    origin = np.array(CAMERA.position)
    with np.errstate(divide="ignore"):
        plane = np.where(rays[:, 2] < 0, -origin[2] / rays[:, 2], np.inf)
    offset = origin - PARAMS[:3]
    b, c = rays @ offset, offset @ offset - PARAMS[3] ** 2
    root = b * b - c
    sphere = np.where(root > 0, -b - np.sqrt(np.maximum(root, 0)), np.inf)
    forward = CAMERA.axes()[2]
    return tuple((t * (rays @ forward)).reshape(SIZE[1], SIZE[0]) for t in (plane, sphere))


def test_depths_are_those_of_the_exact_roots():
    """The last step goes to where a flat face would be, so the ground is exact."""
    plane, sphere = exact_depths()
    moved = replace(SOLIDS, params=np.append(PARAMS[:4], [0, 0, -50, 1]))
    depths = backdrop(CAMERA, SIZE, Sky(), moved).depths
    inside = depths.edge < 0
    exact = np.minimum(plane, sphere)
    near = inside & (exact < 40)
    # On a sphere it leaves, at a glance, up to the half pixel at which a ray counts as a hit.
    half_pixel = 0.5 / CAMERA.focal(SIZE[1])
    assert depths.depth[near] == pytest.approx(exact[near], rel=half_pixel)
    ball = inside & (sphere < 0.97 * plane)
    assert depths.depth[ball] == pytest.approx(sphere[ball], rel=half_pixel)
    assert np.isinf(depths.depth[np.isinf(exact)]).all()


def test_silhouettes_have_sub_samples_and_smooth_colours():
    depths = backdrop(CAMERA, SIZE, Sky(), SOLIDS).depths
    assert len(depths.samples) == (depths.edge >= 0).sum()
    assert 50 < len(depths.samples) < 1200
    spread = np.ptp(np.where(np.isinf(depths.samples), 1e3, depths.samples), axis=1)
    assert (spread > 0.5).sum() > 20


def test_a_surface_is_its_colour_times_sky_and_sun():
    """Ground in the open: color (ambient + sun cos), ambient of the upper half, fading in haze."""
    sky = Sky(sun=Sun(direction=(0, 0, 1), color=(1.0, 1.0, 1.0), glow=0.0), haze=1e6)
    image = backdrop(CAMERA, SIZE, sky, SOLIDS).image
    expected = 0.3 * (0.5 * (np.array(sky.zenith) + sky.horizon) + 1.0)
    assert image[-1, 0, :3] == pytest.approx(expected, rel=0.01)


def test_a_shadow_lies_where_the_sun_is_hidden():
    """Straight below the sphere the ground is dark; off to the side it is not."""
    sky = Sky.plain((0.1, 0.1, 0.1))
    sky = replace(sky, sun=Sun(direction=(0, 0, 1), softness=0.0, glow=0.0), haze=1e6)
    solids = replace(SOLIDS, params=np.append([0, 0, 2, 0.5], [0, 0, -50, 1]))
    camera = Camera(position=(0, -6, 1.5), look_at=(0, 0, 0), field_of_view=40)
    image = backdrop(camera, SIZE, sky, solids).image
    dark = 0.3 * 0.1
    assert image[32, 48, 0] == pytest.approx(dark, rel=0.02)
    assert image[32, 10, 0] == pytest.approx(dark + 0.3 * sky.sun.color[0], rel=0.02)


def test_the_backdrop_is_traced_once_while_nothing_changes(monkeypatch):
    calls = []
    monkeypatch.setattr(
        "motes.renderer.renderer.backdrop", lambda *a: calls.append(a) or backdrop(*a)
    )
    renderer = Renderer(Film(size=SIZE))
    same = Solids(plane_sphere_box, PARAMS.copy(), COLORS.copy())
    first = renderer.draw([], CAMERA, sky=Sky(), solids=SOLIDS)
    second = renderer.draw([], replace(CAMERA, close=Camera()), sky=Sky(), solids=same)
    assert len(calls) == 1
    assert np.array_equal(first.linear, second.linear)
    renderer.draw([], CAMERA, sky=Sky(), solids=replace(SOLIDS, params=PARAMS * 1.01))
    renderer.draw([], CAMERA, sky=Sky(haze=7.0), solids=SOLIDS)
    assert len(calls) == 3


def test_a_plain_sky_is_even_and_no_sky_is_clear():
    image = backdrop(CAMERA, SIZE, Sky.plain((0.2, 0.3, 0.4)), None).image
    assert image[..., :3] == pytest.approx(np.broadcast_to([0.2, 0.3, 0.4], (*SIZE[::-1], 3)))
    assert backdrop(CAMERA, SIZE, None, None).image.max() == 0
    behind = backdrop(CAMERA, SIZE, None, SOLIDS)
    whole = behind.depths.edge < 0
    assert np.array_equal(behind.image[whole, 3] == 1, np.isfinite(behind.depths.depth[whole]))


def test_stars_shine_above_and_solids_hide_them():
    night = replace(Sky.plain((0.0, 0.0, 0.0)), stars=Stars(count=4000))
    renderer = Renderer(Film(size=SIZE, bloom=0.0))
    linear = renderer.draw([], CAMERA, sky=night, solids=SOLIDS).linear
    assert linear[:8].max() > 0.02
    assert linear[-16:, :, :3].max() == 0


def test_solids_without_a_colour_or_with_bad_numbers_are_no_crash():
    with pytest.raises(ValueError, match="no colour"):
        backdrop(CAMERA, SIZE, Sky(), Solids(plane_sphere_box, PARAMS, COLORS[:1]))
    broken = Solids(plane_sphere_box, np.full(8, np.nan, np.float32), COLORS)
    assert np.isfinite(backdrop(CAMERA, SIZE, Sky(), broken).image).all()
    inside = Camera(position=(-1, 0, 1), look_at=(-1, 0, 1), up=(0, 0, 0))
    assert np.isfinite(backdrop(inside, (1, 1), Sky(), SOLIDS).image).all()


@jit(inline=True)
def ball(p, x, y, z):
    """A sphere (center, radius)."""
    dx, dy, dz = x - p[0], y - p[1], z - p[2]
    return np.sqrt(dx * dx + dy * dy + dz * dz) - p[3], 0


GROUND = np.array([[0.0, 0.0, 1.0, 0.0]])


def test_a_plane_reaches_to_the_horizon():
    """Every ray below the horizon meets the ground, at t = height / -ray_z; no other does."""
    solids = Solids(None, np.empty(0), COLORS[:1], GROUND)
    depths = backdrop(CAMERA, SIZE, Sky(), solids).depths
    plane, _ = exact_depths()
    inside = depths.edge < 0
    assert depths.depth[inside] == pytest.approx(plane[inside], rel=1e-3)


def test_the_horizon_is_smooth():
    """Towards the horizon the ground fades into the sky: no line, along it no step."""
    camera = Camera(position=(3, -6, 2), look_at=(0, 0, 1), field_of_view=40)
    size = (640, 360)
    solids = Solids(None, np.empty(0), COLORS[:1], GROUND)
    image = backdrop(camera, size, Sky(haze=20.0), solids).image[..., 1]
    top = round(180 - camera.focal(360) / np.hypot(3, 6))
    assert np.abs(np.diff(image[top - 8 : top + 8], axis=0)).max() < 0.01
    assert np.abs(np.diff(image[top - 8 : top + 8], axis=1)).max() < 1e-3


def test_a_ball_and_a_plane_are_drawn_as_by_one_distance_function():
    """Depth, shadow and colour, but for silhouettes: there a pixel is a mean of 4 points."""
    sky = Sky(sun=Sun(direction=(-1, -0.5, 1.5), softness=0.0))
    apart = Solids(ball, PARAMS[:4], COLORS[[1, 0]], GROUND)
    joined = replace(SOLIDS, params=np.append(PARAMS[:4], [0, 0, -50, 1]))
    first, second = (backdrop(CAMERA, SIZE, sky, solids) for solids in (apart, joined))
    near = (first.depths.depth < 30) & (first.depths.edge < 0) & (second.depths.edge < 0)
    assert near.mean() > 0.5
    assert first.depths.depth[near] == pytest.approx(second.depths.depth[near], rel=0.01)
    differs = np.abs(first.image - second.image).max(axis=2)[near] > 0.01
    assert differs.mean() < 0.01


def test_behind_a_plane_there_is_no_sun():
    """A ground that faces away from the sun is between it and everything."""
    sky = replace(Sky.plain((0.1, 0.1, 0.1)), sun=Sun(direction=(0, -1, -0.1), glow=0.0), haze=1e6)
    solids = Solids(ball, PARAMS[:4], np.ones((2, 3)), GROUND)
    assert backdrop(CAMERA, SIZE, sky, solids).image[..., :3].max() == pytest.approx(0.1, rel=1e-3)


def test_a_ray_that_has_passed_one_solid_meets_the_next():
    """However far a step beyond a near ball leads, the far one behind it is not missed."""
    far = np.array([40.0, 300.0, 0.0, 100.0])

    @jit(inline=True)
    def two(p, x, y, z):
        near, _ = ball(p, x, y, z)
        dx, dy, dz = x - p[4], y - p[5], z - p[6]
        behind = np.sqrt(dx * dx + dy * dy + dz * dz) - p[7]
        return min(near, behind), 0 if near < behind else 1

    params = np.append([0.0, 0.0, 0.0, 1.5], far).astype(np.float32)
    camera = Camera(position=(0, -8, 0), look_at=(0, 0, 0))
    solids = Solids(two, params, COLORS[:2])
    index = backdrop(camera, SIZE, Sky(), solids).views[0].hits.index
    x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    rays = camera.rays(x.ravel(), y.ravel(), SIZE).astype(float)
    offset = np.array(camera.position) - far[:3]
    inside = (rays @ offset) ** 2 - offset @ offset + far[3] ** 2
    pixel = 1000.0  # m2: a ray that passes within half a pixel counts as a hit
    assert (index[inside > 0.0] >= 0).all()
    assert (index[inside < -pixel] <= 0).all()
