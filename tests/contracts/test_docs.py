"""The examples on the pages of docs/ do what the pages say, and links lead somewhere."""

from __future__ import annotations

import importlib.util
import re
import runpy
import shlex
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import motes
from motes import catalog
from motes.cli import main
from motes.scene import loads

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
ALL_PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])

tool = runpy.run_path(str(ROOT / "tools" / "readme.py"))

FILMS = ("demo", "run", "render")
SMALL = ("--frames", "1-2", "--size", "64x36", "--quiet")
"""Given last, these options win: a page may show a whole film, the test makes a tiny one."""


@pytest.fixture
def _own_catalog() -> Iterator[None]:
    """Components that a page declares are gone after it."""
    yield
    for kind, entries in catalog._registry.entries.items():
        for name, part in list(entries.items()):
            if part.__module__ == "<run_path>":
                catalog._forget(kind, name)


def of_script(path: Path, given: dict[str, Any], expected: str, output: Any) -> dict[str, Any]:
    """A page is one story: a script goes on with the names of those before it."""
    made = runpy.run_path(str(path), init_globals=given)
    assert output.readouterr().out == expected
    return {name: value for name, value in made.items() if not name.startswith("__")}


def of_scene(path: Path, expected: str) -> None:
    """A scene loads, or has exactly the problems that the page shows."""
    if not expected:
        motes.load(path.name)
        return
    with pytest.raises(motes.SceneError) as error:
        motes.load(path.name)
    assert str(error.value) == expected.rstrip("\n")


def of_shell(text: str) -> None:
    for command in tool["commands"](text):
        program, *arguments = shlex.split(command)
        assert program == "motes"
        with pytest.raises(SystemExit) as done:
            main([*arguments, *(SMALL if arguments[0] in FILMS else ())])
        assert not done.value.code, command


@pytest.mark.usefixtures("_own_catalog")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_examples_of_a_page_do_what_it_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A block in `text` after a script is what it prints, after a scene its mistakes."""
    monkeypatch.chdir(tmp_path)
    given: dict[str, Any] = {}
    for block, after in pairwise([*tool["blocks"](page.read_text("utf-8")), None]):
        expected = after.text if after is not None and after.language == "text" else ""
        path = tmp_path / block.name
        path.write_text(block.text, "utf-8")
        if block.language == "python":
            given = of_script(path, given, expected, capsys)
        elif block.language == "toml":
            of_scene(path, expected)
        elif block.language == "sh":
            of_shell(block.text)
            capsys.readouterr()


def test_the_readme_shows_what_a_mistake_says() -> None:
    """Its scene with one letter less in a name gives the line that follows it."""
    readme = tool["blocks"]((ROOT / "README.md").read_text("utf-8"))
    scene = next(block for block in readme if block.language == "toml")
    line = next(block for block in readme if block.language == "text")
    with pytest.raises(motes.SceneError) as error:
        loads(scene.text.replace("rate = 0.3", "rat = 0.3"), source=scene.name)
    assert str(error.value) == line.text.rstrip("\n")


def test_the_force_that_contributors_start_from_joins_the_catalog(tmp_path: Path) -> None:
    """Its text as `force/spring.py`: the file's place says kind and type."""
    page = tool["blocks"]((ROOT / "CONTRIBUTING.md").read_text("utf-8"))
    path = tmp_path / "spring.py"
    path.write_text(next(block.text for block in page if block.language == "python"), "utf-8")
    spec = importlib.util.spec_from_file_location("motes.force.spring", path)
    assert spec is not None
    assert spec.loader is not None
    try:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))
        assert motes.force.Spring(stiffness=2.0).document() == {"type": "spring", "stiffness": 2.0}
    finally:
        catalog._forget("force", "spring")


@pytest.mark.parametrize("page", ALL_PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings(page: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, heading = target.partition("#")
        goal = (page.parent / name).resolve() if name else page
        assert goal.exists(), target
        if heading:
            titles = re.findall(r"^#+ (.*)$", goal.read_text("utf-8"), re.MULTILINE)
            anchors = [re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles]
            assert heading in anchors, target


def test_pictures_are_small() -> None:
    """60 kB each and 1 MB in all: a clone stays quick."""
    sizes = [path.stat().st_size for path in (ROOT / "docs" / "pictures").iterdir()]
    assert max(sizes) <= 60_000
    assert sum(sizes) <= 1_000_000
