"""Particles drawn per second, beside peers in the same run: python benchmarks/render.py [--json].

Two million soft dots (two hundred thousand streaks) in a cloud that fills 1920 x 1080, with the
smallest radius that is drawn, 1.9 pixels. Each time is the best of several. Peers: NumPy with 16
`np.add.at` calls, one per pixel of the kernel, which only adds; and datashader, if it is
installed, which counts points into pixels without any size at all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from _report import Report, arguments, best, machine

from motes.renderer import Camera, Film, Layer, Renderer, Sky
from motes.renderer.splat import splat

WIDTH, HEIGHT, RADIUS = 1920, 1080, 1.9
CAMERA = Camera(position=(0, -6.5, 0), look_at=(0, 0, 0), field_of_view=53.13)


def cloud(n: int, opacity: float, length: float = 0.0) -> Layer:
    """n particles, normal with 1 m; streaks of `length` pixels in all directions of the picture."""
    rng = np.random.default_rng(0)
    position = rng.normal(size=(n, 3))
    meters_per_pixel = (6.5 + position[:, 1]) / CAMERA.focal(HEIGHT)
    angle = rng.uniform(0, 2 * np.pi, n)
    way = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1)
    color = rng.random((n, 4))
    color[:, 3] = 1.0
    return Layer(
        position,
        way * (length * meters_per_pixel)[:, None],
        color,
        2 * RADIUS * meters_per_pixel,
        kind="streaks" if length else "points",
        emission=0.0 if opacity else 0.1,
        opacity=opacity,
    )


def numpy_additive(layer: Layer) -> np.ndarray:
    """The same picture of pure light by whole-array operations: one scattered add per tap."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    view = layer.position @ CAMERA.view()[:, :3].T + CAMERA.view()[:, 3]
    focal = CAMERA.focal(HEIGHT)
    x = WIDTH / 2 + view[:, 0] / view[:, 2] * focal - 0.5
    y = HEIGHT / 2 - view[:, 1] / view[:, 2] * focal - 0.5
    left, top = np.floor(x - RADIUS).astype(int) + 1, np.floor(y - RADIUS).astype(int) + 1
    for j in range(4):
        for i in range(4):
            px, py = left + i, top + j
            w = np.maximum(1 - ((px - x) ** 2 + (py - y) ** 2) / RADIUS**2, 0) ** 3
            inside = (px >= 0) & (px < WIDTH) & (py >= 0) & (py < HEIGHT)
            light = (layer.color[:, :3] * w[:, None]).astype(np.float32)
            np.add.at(image, (py[inside], px[inside]), light[inside])
    return image


def datashader_points(layer: Layer) -> Callable[[], object] | None:
    """A count per pixel of the same points, or None without datashader."""
    try:
        import datashader
        import pandas
    except ImportError:
        return None
    frame = pandas.DataFrame({"x": layer.position[:, 0], "y": layer.position[:, 2]})
    canvas = datashader.Canvas(plot_width=WIDTH, plot_height=HEIGHT)
    return lambda: canvas.points(frame, "x", "y")


def measure(*, quick: bool) -> dict[str, float]:
    """Millions of particles per second, and milliseconds of a whole frame."""
    clear = np.zeros((HEIGHT, WIDTH, 4), np.float32)
    n, few = (200_000, 20_000) if quick else (2_000_000, 200_000)
    result = {}
    for name, layer in (
        ("sorted, thin", cloud(n, 0.02)),
        ("sorted, dense", cloud(n, 0.9)),
        ("additive", cloud(n, 0.0)),
        ("streaks of 20 pixels", cloud(few, 0.3, 20.0)),
    ):
        seconds = best(lambda layer=layer: splat([layer], CAMERA, clear, shutter=1.0))
        result[name] = len(layer) / seconds / 1e6
    small = cloud(few, 0.0)
    result["NumPy, additive"] = few / best(lambda: numpy_additive(small), 1) / 1e6
    points = datashader_points(cloud(n, 0.0))
    if points is not None:
        result["datashader, counts"] = n / best(points) / 1e6
    renderer = Renderer(Film(size=(1280, 720)))
    streaks = [cloud(50_000, 0.3, 20.0)]

    def frame() -> object:
        return renderer.draw(streaks, CAMERA, shutter=1.0, sky=Sky()).pixels

    result["frame"] = best(frame) * 1e3
    return result


def main() -> None:
    options = arguments(__doc__).parse_args()
    result = measure(quick=options.quick)
    report = Report(
        f"{WIDTH} x {HEIGHT}, radius {RADIUS} pixels; M particles/s",
        machine=machine(("datashader",)),
    )
    frame = result.pop("frame")
    report.figures.update({name: (rate, "M/s") for name, rate in result.items()})
    report.figures["frame of 1280 x 720, 50 000 streaks, sky, glow, tone map"] = frame, "ms"
    for peer in ("NumPy, additive", "datashader, counts"):
        report.ratio("additive", peer)
    if "datashader, counts" not in result:
        report.notes.append("datashader is not installed")
    report.print(options.json)


if __name__ == "__main__":
    main()
