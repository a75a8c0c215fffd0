"""How far a film is, told to the one who watches."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motes.frame import Frame

if TYPE_CHECKING:
    from motes.simulation import Simulation


@dataclass(frozen=True)
class Progress:
    """How far a film is."""

    done: int = 0
    """Frames that are finished."""

    total: int = 0
    """Frames that the film will have."""

    particles: int = 0
    """Particles in the last frame."""

    particle_steps: int = 0
    """Steps of integration so far, summed over the particles."""

    captures: int = 0
    """Prey that hunters have caught so far."""

    simulating: float = 0.0
    """Time spent on them [s]."""

    compiling: str = ""
    """Name of the kernel that is being compiled, because no earlier run has kept it."""

    still: Path | None = None
    """The first picture, once it is written."""


Watch = Callable[[Progress], None]


class Report:
    """Keeps the progress of a film and tells it to the one who watches."""

    def __init__(self, watch: Watch | None) -> None:
        self._watch = watch
        self._now = Progress()

    def _tell(self, **changes: Any) -> None:
        self._now = replace(self._now, **changes)
        if self._watch is not None:
            self._watch(self._now)

    @contextmanager
    def compiling(self, also: Callable[[], None] | None = None) -> Iterator[None]:
        """Tell of every kernel that is compiled within the block, and call `also`."""
        from motes.jit import listen

        def tell(kernel: str) -> None:
            if also is not None:
                also()
            self._tell(compiling=kernel)

        listen(tell)
        try:
            yield
        finally:
            listen(None)

    def begin(self, total: int) -> None:
        """The number of frames is known."""
        self._tell(total=total)

    def counted(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Pass frames on and tell how many particles they hold."""
        for frame in frames:
            self._tell(particles=frame.count, compiling="")
            yield frame

    def simulated(self, frames: Iterable[Frame], simulation: Simulation) -> Iterator[Frame]:
        """Pass frames on and tell what their simulation cost."""
        begun = time.perf_counter()
        for frame in frames:
            self._tell(
                particles=frame.count,
                particle_steps=simulation.work,
                captures=len(simulation.captures),
                simulating=self._now.simulating + time.perf_counter() - begun,
                compiling="",
            )
            yield frame
            begun = time.perf_counter()

    def still(self, path: Path) -> None:
        """The first picture is written."""
        self._tell(still=path)

    def finished(self) -> None:
        """One more frame is done."""
        self._tell(done=self._now.done + 1)
