"""From a scene to a film: simulate, keep every frame, draw it, encode it.

Simulation and drawing use all threads in turn; keeping and encoding follow on one thread of their
own, so that neither waits for a disk or a codec.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motes.catalog import catalog
from motes.catalog.scripts import script_of
from motes.errors import SceneError
from motes.files import make_folder
from motes.frame import Frame
from motes.jit import cache_folder
from motes.progress import Report, Watch
from motes.record.frames import FrameStore, Manifest, digest_of
from motes.rehearsal import Rehearsal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from motes.renderer import Picture
    from motes.scene import Scene
    from motes.simulation import Simulation

FRAMES = "frames"
"""Folder of the kept frames within the folder of a film."""

STILLS = 6
"""Stills on a contact sheet."""

HELD = 1 << 28
"""Most memory of frames that wait until the first still is drawn [bytes]."""

PATIENCE, EARLY = 2.0, 4.0
"""A first picture is drawn after `PATIENCE` of simulating frames [s], though the first still is not
reached; of the first frame, if `EARLY` have passed since all began."""

WAITING = 3
"""Frames that may wait for the disk and the encoder; more would only use memory."""


@dataclass(frozen=True)
class Made:
    """What was written."""

    film: Path | None
    sheet: Path | None
    """Contact sheet: stills at even distances in time."""

    frames: Path
    """Folder of the kept frames."""

    captures: int = 0
    """How many were caught by hunters."""

    def paths(self) -> list[Path]:
        """All files and folders, the film first."""
        return [path for path in (self.film, self.sheet, self.frames) if path is not None]


def film(
    scene: Scene,
    folder: Path | str,
    *,
    name: str = "film",
    first: int = 1,
    last: int | None = None,
    draw: bool = True,
    form: str = "mp4",
    watch: Watch | None = None,
) -> Made:
    """Simulate a scene and write `name`.mp4, a contact sheet `name`.png and the kept frames.

    `form` is the kind of film: "mp4", "webp" or "gif". `watch` is called with every progress.
    Frames are numbered from 1; frame i shows the time (i - 1) / fps. An exception, Ctrl-C included,
    leaves all finished frames in `folder`/frames, of which `redraw` makes a film.

    Raises:
        SceneError: `first` and `last` name no frame of the film.
        OutputError: a file cannot be written.
        SimulationError: the simulation cannot go on.
    """
    from motes.scene.document import a_scene
    from motes.simulation import Simulation

    report, begun = Report(watch), time.monotonic()
    with (
        Rehearsal(a_scene(scene)) as rehearsal,
        report.compiling(rehearsal.begin if draw else None),
    ):
        if draw and not (cache_folder() / "kernels").is_dir():
            rehearsal.begin()  # Nothing has ever been compiled here.
        simulation = Simulation(scene)
        numbers = _numbers(first, last, range(1, simulation.frame_count + 1))
        report.begin(len(numbers))
        store = FrameStore.create(Path(folder) / FRAMES, _manifest(scene, name))
        with _Follower() as follower:
            frames = _kept(simulation, numbers, store, follower, report)
            if draw:
                path = Path(folder) / f"{name}.{form}"
                sheet = _draw(frames, numbers, scene, path, follower, report, begun, rehearsal)
                return Made(path, sheet, store.folder, len(simulation.captures))
            for _ in frames:
                report.finished()
    return Made(None, None, store.folder, len(simulation.captures))


def redraw(
    folder: Path | str,
    *,
    values: Mapping[str, Any] | None = None,
    first: int = 1,
    last: int | None = None,
    output: Path | str | None = None,
    form: str = "mp4",
    watch: Watch | None = None,
) -> Made:
    """Make the film again from the frames that `film` kept in `folder`.

    `values` change what only drawing depends on: {"film.size": [1920, 1080]}, camera, looks.

    Raises:
        OutputError: there are no frames, or one is damaged.
        SceneError: a value does not fit, or `first` and `last` name no kept frame.
    """
    from motes.scene import drawable, from_document

    store = open_frames(folder)
    _require(store.manifest.scripts)
    document = drawable(store.manifest.scene)
    scene = from_document(document, source=str(store.folder / "manifest.json"))
    scene = scene.with_values(values or {})
    numbers = _numbers(first, last, store.numbers())
    report, begun = Report(watch), time.monotonic()
    report.begin(len(numbers))
    target = Path(output) if output is not None else store.folder.parent
    path = target / f"{store.manifest.name}.{form}"
    with report.compiling(), _Follower() as follower:
        frames = report.counted(store.read(number) for number in numbers)
        sheet = _draw(frames, numbers, scene, path, follower, report, begun)
    return Made(path, sheet, store.folder)


def open_frames(folder: Path | str) -> FrameStore:
    """The kept frames of a film, from its folder or the folder of frames itself.

    Raises:
        OutputError: there are none.
    """
    inner = Path(folder) / FRAMES
    return FrameStore.open(inner if inner.is_dir() else folder)


def _numbers(first: int, last: int | None, there: Iterable[int]) -> list[int]:
    """The frames that are wanted, of those that there are."""
    menu = list(there)
    numbers = [n for n in menu if first <= n and (last is None or n <= last)]
    if not numbers:
        wanted = f"{first}-{'' if last is None else last}"
        has = f"has frames {menu[0]}-{menu[-1]}" if menu else "has no frames yet"
        raise SceneError(f"no frames {wanted}: the film {has}.", source="frames")
    return numbers


def _manifest(scene: Scene, name: str) -> Manifest:
    document = scene.document()
    release = version("motes")
    owners = (scene, *scene.systems)
    lists = ("emit", "force", "flow", "interact", "solid", "retire")
    parts = [part for owner in owners for name in lists for part in getattr(owner, name, ())]
    sources = {f"{part.kind.name}/{part.type}": part.source() for part in parts}
    digest = digest_of(release, document, sources)
    scripts = {
        f"{part.kind.name}/{part.type}": script
        for part in (*parts, *(system.look for system in scene.systems))
        if (script := script_of(type(part))) is not None
    }
    return Manifest(name, document, digest, float(scene.film.fps), release, scripts)


def _require(scripts: Mapping[str, str]) -> None:
    """Refuse to draw without the solids and looks that somebody's own file declares."""
    for address, script in scripts.items():
        kind, _, part = address.partition("/")
        if kind not in ("solid", "look") or part in catalog(kind):
            continue
        where, fix = "at a prompt or in a notebook", "Call motes.redraw there."
        if script:
            where = f"in {script}"
            fix = f"Add --components {script}, which runs that file, or call motes.redraw in it."
        raise SceneError(f'the {kind} "{part}" was declared {where}. {fix}', source="")


def _kept(
    simulation: Simulation,
    numbers: list[int],
    store: FrameStore,
    follower: _Follower,
    report: Report,
) -> Iterator[Frame]:
    """Frames of a simulation, each on its way to the store before anybody draws it.

    Energies are noted when the next one is asked for, so that the first picture need not wait.
    """
    frames, told = simulation.frames(first=numbers[0], last=numbers[-1]), 0
    interacts = bool(store.manifest.scene.get("interact"))
    for frame in report.simulated(frames, simulation):
        follower.add(store.write, frame)
        yield frame
        if interacts:
            # Of the last whole step before the frame, whose time they state.
            captures = simulation.captures
            if frame.index == numbers[0] > 1:  # The frames before have told of theirs.
                before = frame.time - 1 / simulation.scene.film.fps
                told = sum(1 for one in captures if one["time"] <= before * (1 + 1e-12))
            noted = frame.index, simulation.measure(), captures[told:]
            follower.add(lambda noted: store.note(*noted), noted)
            told = len(captures)


def _draw(
    frames: Iterable[Frame],
    numbers: list[int],
    scene: Scene,
    path: Path,
    follower: _Follower,
    report: Report,
    begun: float,
    rehearsal: Rehearsal | None = None,
) -> Path:
    """Draw frames into a film at `path`; gives its contact sheet, until then the first still."""
    from motes.renderer import Video, contact_sheet
    from motes.studio import Studio

    studio = Studio(scene)
    sheet = path.with_suffix(".png")
    chosen = {numbers[(2 * i + 1) * len(numbers) // (2 * STILLS)] for i in range(STILLS)}
    stills: list[NDArray[np.uint8]] = []
    times: list[float] = []
    make_folder(path.parent)

    def show(picture: Picture) -> None:
        picture.save(sheet)
        report.still(sheet)

    with Video(path, fps=scene.film.fps) as video, follower.emptied():
        frames = iter(frames)
        ahead = _ahead(frames, min(chosen), begun)
        if rehearsal is not None:
            # By now this process has compiled what simulates; it compiles nothing twice.
            rehearsal.wait()
        for frame, picture in _pictures(ahead, frames, studio.draw, show):
            follower.add(video.write, picture.pixels)
            if frame.index in chosen:
                stills.append(picture.pixels)
                times.append(frame.time)
            report.finished()
    contact_sheet(stills, times, sheet)
    return sheet


def _ahead(frames: Iterable[Frame], still: int, begun: float) -> list[Frame]:
    """The frames up to the first still, or as many as may wait in memory and be waited for."""
    held: list[Frame] = []
    room, now = HELD, time.monotonic()
    late = min(now + PATIENCE, begun + EARLY)
    for frame in frames:
        held.append(frame)
        room -= sum(a.nbytes for columns in frame.systems.values() for a in columns.values())
        if frame.index >= still or room < 0 or time.monotonic() > late:
            break
    return held


def _pictures(
    ahead: list[Frame],
    frames: Iterable[Frame],
    draw: Callable[[Frame], Picture],
    show: Callable[[Picture], None],
) -> Iterator[tuple[Frame, Picture]]:
    """Frames with their pictures, in order; the last one of `ahead` is drawn and shown first."""
    early = draw(ahead[-1])
    show(early)
    for frame in ahead[:-1]:
        yield frame, draw(frame)
    yield ahead[-1], early
    for frame in frames:
        yield frame, draw(frame)


class _Follower:
    """One thread that does what it is given in order; at most `WAITING` frames wait for it."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, "motes-follower")
        self._waiting: deque[Future[Any]] = deque()

    def __enter__(self) -> _Follower:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._pool.shutdown()
        if kind is None:
            self.wait()

    def add(self, task: Callable[[Any], Any], thing: Any) -> None:
        """Do `task(thing)` soon; an exception of an earlier task is raised here."""
        while len(self._waiting) >= 2 * WAITING:
            self._waiting.popleft().result()
        self._waiting.append(self._pool.submit(task, thing))

    @contextmanager
    def emptied(self) -> Iterator[None]:
        """At the end of the block, wait for all that was given, so that nothing uses it later."""
        try:
            yield
        finally:
            self.wait()

    def wait(self) -> None:
        """Wait for all that was given; the first exception is raised when nothing runs any more."""
        given, self._waiting = self._waiting, deque()
        wait(given)
        for future in given:
            future.result()
