"""Pictures of ODE problems: every one is drawn, and the command says what it did."""

from __future__ import annotations

import builtins
from pathlib import Path

import numpy as np
import pytest

from motes.cli import main
from motes.errors import MissingExtra, SceneError
from motes.problem import about, names, problem


def outcome(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


@pytest.mark.parametrize("name", names())
def test_problems_are_consistent(name: str):
    """The exact solution starts at the start and obeys f; the energy is kept by f."""
    of = problem(name)
    assert about(name)
    y = np.array(of.start)
    assert of.f(of.span[0], y).shape == y.shape
    h = 1e-6
    moved = np.stack([y - h * of.f(0.0, y), y + h * of.f(0.0, y)])
    if of.energy is not None:
        low, high = of.energy(moved)
        size = np.abs(of.f(0.0, y)).max() * max(1.0, abs(low))
        assert abs(high - low) / (2 * h) < 1e-6 * size
    if of.exact is not None:
        assert of.exact(np.zeros(1))[0] == pytest.approx(y)
        slope = np.diff(of.exact(np.array([1 - h, 1 + h])), axis=0)[0] / (2 * h)
        assert slope == pytest.approx(of.f(1.0, of.exact(np.ones(1))[0]), abs=1e-6)


def test_the_command_writes_one_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    pytest.importorskip("matplotlib")
    target = tmp_path / "circle.png"
    steps = ("--method", "euler,rk4", "--step", "0.5,0.25", "--save", str(target))
    assert outcome("ode", "circle", *steps) == 0
    assert capsys.readouterr().out.strip() == str(target)
    assert target.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("circel",), 'Did you mean "circle"'),
        (("circle", "--method", "rk5"), 'Did you mean "rk4"'),
        (("circle", "--step", "0"), "above 0"),
        (("circle", "--method", "leapfrog"), "for x'' = a"),
        (("circle", "--step", "1e-9"), "too short for a picture"),
        (("circle", "--save", "circle.jpg"), ".png"),
    ],
)
def test_mistakes_get_one_line(arguments, message, capsys: pytest.CaptureFixture[str]):
    assert outcome("ode", *arguments) == 2
    said = capsys.readouterr().err
    assert message in said
    assert "Traceback" not in said


def test_steps_and_methods_that_come_twice_count_once(tmp_path: Path):
    pytest.importorskip("matplotlib")
    from motes.ode.picture import draw

    figure = draw("kepler", methods=["rk4", "rk4", "euler"], steps=[0.05, 0.05, 0.025])
    errors = figure.axes[1]
    assert [line.get_label() for line in errors.lines] == ["rk4, slope 4.6", "euler, far off"]
    assert [len(line.get_xdata()) for line in errors.lines] == [2, 2]


def test_the_list_names_problems_and_methods(capsys: pytest.CaptureFixture[str]):
    assert outcome("ode") == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("pleiades", "radau5", "symplectic"))


def test_without_matplotlib_the_install_line_is_named(monkeypatch: pytest.MonkeyPatch):
    real = builtins.__import__

    def refuse(name, *rest, **named):
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *rest, **named)

    from motes.ode.picture import draw

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingExtra, match=r"pip install 'motes\[plot\]'"):
        draw("circle")
    with pytest.raises(SceneError):
        problem("nothing")
