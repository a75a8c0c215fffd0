"""Kept frames: a folder with a manifest and one file a frame, each whole or absent.

The folder is the list: a frame exists when its file does. Nothing else has to be kept in step with
it, so a run that is killed loses no finished frame, and several processes may fill one folder.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from motes.errors import OutputError
from motes.files import content, fault, sweep, written_whole
from motes.frame import Frame
from motes.record.encoding import decode, encode, glance
from motes.record.energy import Measures, from_json, to_json

FORMAT = 1
"""Version of the manifest; it grows when an older motes would misread a newer one."""

MANIFEST = "manifest.json"

_FRAME = re.compile(r"(\d{5,})\.frame", re.ASCII)


@dataclass(frozen=True)
class Manifest:
    """What the frames of a folder are."""

    name: str
    """What files made of the frames are called: `sprinkler`."""

    scene: Mapping[str, Any]
    """The scene's document."""

    digest: str
    """Hash of everything that decides the frames; equal digests mean equal frames."""

    fps: float
    """Frames per second of the film."""

    version: str
    """The version of motes that simulated."""

    scripts: Mapping[str, str] = field(default_factory=dict)
    """Files of the components that do not come with motes, by kind and type: "solid/bump"."""

    def __post_init__(self) -> None:
        """A manifest may come from anybody: its name becomes the name of files.

        Raises:
            ValueError: a field is not what it should be.
        """
        texts = (self.name, self.digest, self.version, *self.scripts, *self.scripts.values())
        if not all(isinstance(text, str) for text in texts):
            raise ValueError("a text is something else")
        if (
            not self.name
            or Path(self.name).name != self.name
            or set(self.name) & set('\\/:*?"<>|\0')
        ):
            raise ValueError(f'"{self.name}" is no name of a file')
        if not isinstance(self.scene, Mapping) or not 0 < self.fps < math.inf:
            raise ValueError("the scene or its fps is something else")


@dataclass(frozen=True)
class FrameStore:
    """Frames in a folder.

    `store.write(frame)` keeps one, `store.read(12)` gives one back exactly, `store.numbers()` says
    which there are. Beside frames of a scene with interactions, `store.measures()` has energy,
    momentum and virial ratio by frame, and `store.captures()` who caught whom.
    """

    folder: Path
    manifest: Manifest

    @classmethod
    def create(cls, folder: Path | str, manifest: Manifest) -> FrameStore:
        """Begin a folder, or go on with one of the same digest; frames of another are removed.

        Raises:
            OutputError: the folder cannot be written.
        """
        store = cls(Path(folder), manifest)
        path = store.folder / MANIFEST
        if path.exists() and not store._same(path):
            store._clear()
        text = json.dumps({"format": FORMAT, **asdict(manifest)}, indent=2, ensure_ascii=False)
        with written_whole(path) as file:
            file.write(text.encode() + b"\n")
        sweep(store.folder)
        return store

    @classmethod
    def open(cls, folder: Path | str) -> FrameStore:
        """Open a folder of kept frames.

        Raises:
            OutputError: there are no frames, or a newer motes wrote them.
        """
        path = Path(folder) / MANIFEST
        if not path.is_file():
            raise OutputError(f"{folder} holds no kept frames (there is no {path}).")
        try:
            fields = json.loads(content(path))
            version = fields.pop("format")
            if version > FORMAT:
                raise OutputError(
                    f"{path} has format {version}, and this motes reads up to {FORMAT}. "
                    f"A newer motes ({fields.get('version', 'unknown')}) wrote it; install that."
                )
            return cls(Path(folder), Manifest(**fields))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise OutputError(f"{path} is not a manifest of kept frames.") from error

    def _same(self, path: Path) -> bool:
        try:
            return FrameStore.open(path.parent).manifest.digest == self.manifest.digest
        except OutputError:
            return False

    def _clear(self) -> None:
        for number in self.numbers():
            for path in (self._notes(number), self.path(number)):
                try:
                    path.unlink(missing_ok=True)
                except OSError as error:
                    raise fault("remove", path, error) from error

    def path(self, number: int) -> Path:
        """The file of a frame."""
        return self.folder / f"{number:05d}.frame"

    def numbers(self) -> list[int]:
        """Numbers of the frames that are there, in order.

        Raises:
            OutputError: the folder cannot be read.
        """
        try:
            names = [path.name for path in self.folder.iterdir()]
        except OSError as error:
            raise fault("read", self.folder, error) from error
        matches = filter(None, map(_FRAME.fullmatch, names))
        return sorted(int(match[1]) for match in matches)

    def size(self) -> int:
        """Bytes on disk of all frames."""
        return sum(self.path(number).stat().st_size for number in self.numbers())

    def write(self, frame: Frame) -> Path:
        """Keep a frame, and give its file.

        Raises:
            OutputError: the file cannot be written, or another run has begun in the folder.
            TypeError: a column is not an array of numbers.
        """
        path = self.path(frame.index)
        if not self._same(self.folder / MANIFEST):
            raise OutputError(
                f"{self.folder} was removed, or taken by a run of another scene. "
                "Give each run a folder of its own."
            )
        with written_whole(path) as file:
            for part in encode(frame, self.manifest.digest):
                file.write(part)
        return path

    def read(self, number: int) -> Frame:
        """One frame as it was written, bit for bit.

        Raises:
            OutputError: the frame is not there, damaged, of another film, or written by a newer
                motes.
        """
        path = self.path(number)
        frame = decode(content(path), path, self.manifest.digest)
        if frame.index != number:
            raise OutputError(f"{path} is damaged: it holds frame {frame.index}.")
        return frame

    def faults(self, *, whole: bool = False) -> dict[int, str]:
        """What is wrong with frames, by number: their lengths, or their `whole` content."""
        found: dict[int, str] = {}
        for number in self.numbers():
            try:
                if whole:
                    self.read(number)
                else:
                    glance(self.path(number), self.manifest.digest)
            except OutputError as error:
                found[number] = str(error)
        return found

    def note(self, number: int, measures: Measures, captures: NDArray[Any] | None = None) -> None:
        """Keep energy, momentum and the rest beside a frame, and captures since the frame before.

        Raises:
            OutputError: the file cannot be written.
        """
        told = () if captures is None else captures
        each = [{key: one[key].tolist() for key in one.dtype.names} for one in told]
        noted = {**to_json(measures), "captures": each}
        with written_whole(self._notes(number)) as file:
            file.write(json.dumps(noted).encode() + b"\n")

    def measures(self) -> dict[int, Measures]:
        """What was noted beside each frame, by its number, in order.

        Raises:
            OutputError: a file is damaged.
        """
        return {number: measures for number, measures, _ in self._noted()}

    def captures(self) -> list[dict[str, Any]]:
        """Captures up to the last frame, in order: time [s], hunter and prey (ids), place [m].

        Raises:
            OutputError: a file is damaged.
        """
        return [one for _, _, captures in self._noted() for one in captures]

    def _noted(self) -> Iterator[tuple[int, Measures, list[dict[str, Any]]]]:
        """Frame numbers with what was noted beside them."""
        for number in self.numbers():
            path = self._notes(number)
            if path.is_file():
                try:
                    noted = json.loads(content(path))
                    captures = noted.pop("captures", [])
                    yield number, from_json(noted), list(captures)
                except (ValueError, TypeError, AttributeError) as error:
                    raise OutputError(f"{path} is damaged: it holds no measures.") from error

    def _notes(self, number: int) -> Path:
        return self.folder / f"{number:05d}.measures.json"

    def __iter__(self) -> Iterator[Frame]:
        """All frames in order, one in memory at a time."""
        return (self.read(number) for number in self.numbers())


def digest_of(*parts: Any) -> str:
    """One hash of values that JSON can hold, the same on every machine."""
    text = json.dumps(parts, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]
