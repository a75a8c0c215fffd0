"""Draw the pictures of docs/ode.md by the commands that it shows: python docs/ode_pictures.py."""

from __future__ import annotations

import subprocess
from pathlib import Path

PAGE = Path(__file__).with_name("ode.md")


def commands() -> list[str]:
    """The page's lines that draw pictures."""
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.startswith("motes ode ") and "--save" in line]


if __name__ == "__main__":
    for command in commands():
        print(command, flush=True)
        subprocess.run(command.split(), check=True, cwd=PAGE.parent)
