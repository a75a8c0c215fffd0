"""The gallery: scenes that come with motes and run from their names."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from pathlib import Path

from motes.errors import SceneError, likely


def _names() -> list[str]:
    entries = files("motes").joinpath("scenes").iterdir()
    return sorted(Path(e.name).stem for e in entries if e.name.endswith(".toml"))


def gallery() -> dict[str, str]:
    """Names of the scenes with their titles, in alphabetical order."""
    return {name: str(tomllib.loads(gallery_text(name)).get("title", name)) for name in _names()}


def gallery_text(name: str) -> str:
    """The text of a scene of the gallery, with its comments.

    Raises SceneError with the menu where there is none of that name.
    """
    if name not in _names():
        raise unknown(name, "no scene")
    return files("motes").joinpath("scenes", f"{name}.toml").read_text("utf-8")


def unknown(name: str, what: str) -> SceneError:
    """The error for a scene that is not there."""
    if Path(name).exists():
        what = "a folder, not a scene:" if Path(name).is_dir() else "not a file that holds a scene:"
    names = _names()
    hint = likely(Path(name).stem, names)
    menu = f"The gallery has: {', '.join(names)}. A file of your own ends in .toml or .json."
    return SceneError(f'{what} "{name}".{hint} {menu}', source="")
