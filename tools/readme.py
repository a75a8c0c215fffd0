"""Run the examples of README.md as they stand there: `python3 tools/readme.py FOLDER`.

FOLDER is new or empty; everything happens in it. Of a fenced block in `toml` or `python` that
begins with a comment such as `# jet.toml`, this is the file's name. A scene is checked, a script is
run, and of a block in `sh` every line. Steps that need the project's own folder or change the
environment (making and entering it, installing, the tests) are left out of a line, and the rest of
it is run.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"

LEFT_OUT = ("python3 -m venv ", ". .venv/", "python3 -m pip install ", "python3 -m pytest")
"""Beginnings of steps that are not run."""

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_NAME = re.compile(r"# ([\w-]+\.(?:toml|json|py))\n")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    text: str
    line: int
    """Line of the page at which its text begins."""

    @property
    def name(self) -> str:
        """Name of the file that it is."""
        if match := _NAME.match(self.text):
            return match[1]
        return f"line_{self.line}.{'py' if self.language == 'python' else self.language}"


def blocks(page: str) -> list[Block]:
    """The fenced blocks of a Markdown page that name their language, in order."""
    return [
        Block(match[1], match[2], page.count("\n", 0, match.start(2)) + 1)
        for match in _BLOCK.finditer(page)
    ]


def commands(text: str) -> Iterator[str]:
    """The lines of a block in `sh` without comments and without the steps that are left out."""
    for line in text.splitlines():
        steps = re.sub(r"(^|\s)#.*", "", line).strip().split(" && ")
        if run := [step for step in steps if step and not step.startswith(LEFT_OUT)]:
            yield " && ".join(run)


def perform(block: Block, folder: Path) -> None:
    """Run one block in a folder. Raises CalledProcessError where a command fails."""
    if block.language == "sh":
        for command in commands(block.text):
            run(command, folder)
    elif block.language in ("toml", "python"):
        (folder / block.name).write_text(block.text, "utf-8")
        run(f"{'python' if block.language == 'python' else 'motes check'} {block.name}", folder)


def run(command: str, folder: Path) -> None:
    """Run one command with the programs of this interpreter's environment first."""
    print(f"$ {command}", flush=True)
    begun = time.perf_counter()
    programs = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    subprocess.run(
        command, shell=True, check=True, cwd=folder, env={**os.environ, "PATH": programs}
    )
    print(f"  {time.perf_counter() - begun:.1f} s", flush=True)


def main(arguments: list[str]) -> int:
    """Run all blocks up to the first that fails; the exit code."""
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        print(f"{folder} is not empty.", file=sys.stderr)
        return 2
    for block in blocks(README.read_text("utf-8")):
        try:
            perform(block, folder)
        except subprocess.CalledProcessError as error:
            print(f"README.md:{block.line}: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
