"""What a person sees on the terminal while a film is made."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from motes.progress import Progress

COMPILING = "compiling (first run only)"


@contextmanager
def shown(name: str, *, quiet: bool, verbose: bool) -> Iterator[Callable[[Progress], None]]:
    """A function that shows progress on stderr: a live line on a terminal, else single lines."""
    if quiet:
        yield lambda progress: None
    elif sys.stderr.isatty():
        with _live(name) as watch:
            yield watch
    else:
        yield _Lines(name, verbose)


@contextmanager
def _live(name: str) -> Iterator[Callable[[Progress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description}"),
        BarColumn(None),
        TextColumn("{task.fields[work]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None, work="")
        told = set()

        def watch(progress: Progress) -> None:
            if progress.still is not None and progress.still not in told:
                told.add(progress.still)
                bar.console.print(f"first picture: {progress.still}", highlight=False)
            bar.update(
                task,
                description=COMPILING if progress.compiling else name,
                completed=progress.done,
                total=progress.total or None,
                work=work(progress),
            )

        yield watch


class _Lines:
    """For a file or a pipe: a line when something new begins, with -v one every few seconds."""

    EVERY = 5.0

    def __init__(self, name: str, verbose: bool) -> None:
        self._name = name
        self._verbose = verbose
        self._told: set[str] = set()
        self._last = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        if progress.compiling:
            self._once(COMPILING)
        if progress.still is not None:
            self._once(f"first picture: {progress.still}")
        if self._verbose and time.monotonic() - self._last > self.EVERY:
            self._last = time.monotonic()
            click.echo(f"{self._name} {work(progress)}", err=True)

    def _once(self, line: str) -> None:
        if line not in self._told:
            self._told.add(line)
            click.echo(line, err=True)


def work(progress: Progress) -> str:
    """How far it is: `12/144 frames, 50.2 k particles, 812 M particle-steps/s, 3 caught`."""
    if not progress.done:
        return ""
    text = f"{progress.done}/{progress.total} frames, {rounded(progress.particles)} particles"
    if progress.simulating > 0 and progress.particle_steps:
        rate = progress.particle_steps / progress.simulating
        text += f", {rounded(rate)} particle-steps/s"
    if progress.captures:
        text += f", {progress.captures} caught"
    return text


def rounded(number: float) -> str:
    """A number with three digits and its thousands: `50.2 k`."""
    for unit in ("", " k", " M", " G"):
        if abs(number) < 999.5 or unit == " G":
            return f"{number:.3g}{unit}"
        number /= 1000
    raise AssertionError
