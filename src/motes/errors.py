"""What can go wrong, said in one line: where, what, the likely fix, and the menu."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

LONGEST_WORD = 64
"""Words beyond this length get no hint, because to compare them would take long."""

LONGEST_LINE = 1000
"""Characters of a line about one problem."""

MOST_LINES = 100
"""Problems of one scene that are shown."""


class MotesError(Exception):
    """Base of every error that motes raises on purpose; its text is for the person who reads it."""

    exit_code = 1


class SimulationError(MotesError):
    """A simulation cannot go on: a particle became infinite, a solver found no step."""


class MissingExtra(MotesError):
    """An optional package is not installed; the text names the `pip install` that brings it."""

    exit_code = 3


class OutputError(MotesError):
    """A file could not be read or written."""

    exit_code = 74


class MemoryBudgetError(MotesError, MemoryError):
    """An array would not fit into the memory budget; nothing was allocated."""

    exit_code = 75


class ValueFault(ValueError):
    """A value is wrong in one line; `path` leads to the place within it, where it has parts."""

    def __init__(self, message: str, path: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.path = path


@contextmanager
def within(*path: str | int) -> Iterator[None]:
    """Add where in a value the block is to any ValueError that it raises."""
    try:
        yield
    except ValueError as fault:
        raise ValueFault(str(fault), (*path, *path_of(fault))) from None


def path_of(fault: ValueError) -> tuple[str | int, ...]:
    """Where in a value a fault is, as far as it is known."""
    return fault.path if isinstance(fault, ValueFault) else ()


@dataclass(frozen=True)
class Problem:
    """One fault in a scene.

    `path` is where it is, as keys and list positions: ("system", 0, "emit", 1, "rate").
    """

    path: tuple[str | int, ...]
    message: str
    line: int | None = None


class SceneError(MotesError, ValueError):
    """A scene is not valid. Holds every problem that was found, not only the first.

    `source` names where it was read from; it is empty where a scene is built in Python.
    """

    exit_code = 2

    def __init__(self, problems: Sequence[Problem] | str, source: str = "scene") -> None:
        if isinstance(problems, str):
            problems = [Problem((), problems)]
        self.problems = tuple(problems)
        self.source = source
        super().__init__("\n".join(self.lines()))

    def lines(self) -> list[str]:
        """One line of text for each problem, in the order of the document; not too many."""
        ordered = sorted(self.problems, key=lambda p: (p.line is None, p.line or 0))
        lines = [_printable(f"{self._place(p)}{p.message}") for p in ordered[:MOST_LINES]]
        if len(ordered) > MOST_LINES:
            lines.append(f"and {len(ordered) - MOST_LINES} more problems.")
        return lines

    def _place(self, problem: Problem) -> str:
        if not self.source:
            return ""
        return f"{self.source}:{problem.line}: " if problem.line else f"{self.source}: "


def _printable(text: str) -> str:
    """The text on one line: a scene of somebody else must not fill or control the terminal."""
    if len(text) > LONGEST_LINE:
        text = text[: LONGEST_LINE - 3] + "..."
    return "".join(c if c.isprintable() else " " for c in text)


def likely(word: str, menu: Iterable[str]) -> str:
    """A hint such as ` Did you mean "rate"?`, or nothing when no entry of the menu is close.

    An entry that goes on where the word stops is closer than any other.
    """
    if len(word) > LONGEST_WORD:
        return ""
    entries = list(menu)
    longer = [entry for entry in entries if len(word) > 1 and entry.startswith(word)]
    close = sorted(longer, key=len) or difflib.get_close_matches(word, entries, 1, 0.6)
    return f' Did you mean "{close[0]}"?' if close else ""
