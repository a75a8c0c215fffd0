"""The examples run as they are, are as short as they claim, and write a film."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

LONGEST = 20
"""Lines of an example, imports and words included."""

EXAMPLES = sorted(Path(__file__).parents[2].joinpath("examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_writes_its_film(
    example: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("av")
    assert len(example.read_text("utf-8").splitlines()) <= LONGEST
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example))
    film = tmp_path / capsys.readouterr().out.strip()
    assert film.stat().st_size > 10_000
