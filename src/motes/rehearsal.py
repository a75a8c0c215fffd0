"""Compile what draws in a second process, while the first one compiles what simulates.

The compiler works on one function at a time in a process. On an empty kernel cache, two processes
have the first picture of a film in two thirds of the time. What the second one compiles reaches the
first through the kernel cache; should it fail, the first compiles by itself.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.frame import Frame

if TYPE_CHECKING:
    from motes.scene import Scene

SIZE = (96, 54)
"""Size of that picture: its kernels are those of a large one."""

LONGEST = 60.0
"""Time after which nobody waits any longer [s]."""


class Rehearsal:
    """Draws a first picture of a scene in another process, which is ended with the block."""

    def __init__(self, scene: Scene) -> None:
        self._document = json.dumps(scene.document())
        self._process: subprocess.Popen[str] | None = None

    def begin(self) -> None:
        """Start, unless it has been started, or one processor is all there is."""
        from motes.jit import available_processors

        if self._process is not None or available_processors() < 2:
            return
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "motes.rehearsal"],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "MOTES_THREADS": "1"},
                text=True,
            )
            assert self._process.stdin is not None
            with self._process.stdin as document:
                document.write(self._document)
        except OSError:
            pass  # Where no process can be started, the first one does the work.

    def wait(self) -> None:
        """Wait until it is over."""
        if self._process is not None:
            try:
                self._process.wait(LONGEST)
            except subprocess.TimeoutExpired:
                self._process.kill()

    def __enter__(self) -> Rehearsal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()


def frame_of(scene: Scene) -> Frame:
    """A frame with one particle in each system, where the camera looks."""
    place = np.array([scene.camera.values["look_at"].at(0.0)[:3]], np.float32)
    columns: dict[str, NDArray[Any]] = {
        "position": place,
        "velocity": np.ones((1, 3), np.float32),
        "color": np.ones((1, 4), np.float32),
        "size": np.full(1, 0.1, np.float32),
        "age": np.zeros(1, np.float32),
        "id": np.zeros(1, np.uint64),
    }
    return Frame(0.0, 1, {system.name: columns for system in scene.systems})


def main() -> None:
    """Draw the scene whose document comes on stdin."""
    from motes.scene import from_document
    from motes.studio import Studio

    scene = from_document(json.load(sys.stdin))
    _ = Studio(scene, size=SIZE).draw(frame_of(scene)).pixels


if __name__ == "__main__":
    main()
    os._exit(0)  # Nobody needs to clean up, which would take as long as a kernel.
