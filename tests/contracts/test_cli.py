"""The command line: what is printed where, exit codes, and what is not imported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from jet import MANIFEST, jet

import motes
from motes.cli import COMMANDS, main
from motes.cli.info import ranges
from motes.cli.options import assignment, frame_range, picture_size
from motes.cli.progress import rounded, work
from motes.errors import (
    MemoryBudgetError,
    MissingExtra,
    MotesError,
    OutputError,
    Problem,
    SceneError,
    SimulationError,
)
from motes.production import Made
from motes.progress import Progress
from motes.record.frames import FrameStore

HEAVY = ("numba", "numpy", "pydantic", "rich", "PIL", "av", "scipy")


def outcome(*arguments: str) -> int:
    with pytest.raises(SystemExit) as done:
        main(arguments)
    code = done.value.code
    assert isinstance(code, int)
    return code


def subprocess_of(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "from motes.cli import main; main()", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, **options)


class Scene(SimpleNamespace):
    """As much of a scene as the commands look at."""

    def with_values(self, values: dict[str, Any]) -> Scene:
        return Scene(**{**vars(self), "values": values})


SCENE = Scene(
    systems=[SimpleNamespace(name="water")], duration=6.0, film=SimpleNamespace(fps=24), values={}
)


@pytest.fixture
def studio(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The library without its engine: remembers the last call."""
    calls = SimpleNamespace(film={}, error=None, threads=None)

    def film(scene: Scene, folder: Path, **options: Any) -> Made:
        calls.film = {"scene": scene, "folder": folder, **options}
        options["watch"](Progress(total=2, compiling="step"))
        options["watch"](Progress(done=1, total=2, particles=3, still=Path("a.png")))
        if calls.error is not None:
            raise calls.error
        return Made(Path("a.mp4"), Path("a.png"), Path("frames"))

    monkeypatch.setattr(motes, "load", lambda name: SCENE, raising=False)
    monkeypatch.setattr(motes, "film", film, raising=False)
    monkeypatch.setattr(motes, "threads", lambda n: setattr(calls, "threads", n), raising=False)
    return calls


@pytest.mark.parametrize("arguments", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    program = (
        "import sys; from motes.cli import main\n"
        f"try: main({arguments})\n"
        f"except SystemExit as done: print([m for m in {HEAVY} if m in sys.modules], done.code)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.startswith("Usage: motes")
    assert done.stdout.endswith("[] 0\n")


def test_motes_alone_shows_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome() == 0
    text = capsys.readouterr().out
    assert all(f"\n  {name} " in text for name in COMMANDS)
    assert outcome("--version") == 0
    assert capsys.readouterr().out.startswith("motes ")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["rn"], 'no command "rn". Did you mean "run"?'),
        (["my.toml"], "Did you mean `motes run my.toml`?"),
        (["run"], "Missing argument 'SCENE'"),
        (["run", "a", "--frames", "5-2"], "the last is not before the first"),
        (["run", "a", "--frames", "x"], '"x" is not a range of frames such as 1-48'),
        (["run", "a", "--size", "12"], '"12" is not a size such as 1920x1080'),
        (["run", "a", "--set", "rate"], '"rate" is not ADDRESS=VALUE'),
        (["run", "a", "--set", "a=[1"], "'[1' is not a value"),
        (["run", "a", "--set", "a=1\nb=2"], "is not a value"),
        (["run", "a", "--precision", "half"], "'half' is not one of"),
        (["run", "a", "-o", "a.mp4"], "-o names a folder, not a file. Write -o a "),
        (["run", "a", "--nonsense"], "No such option"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert outcome(*arguments) == 2
    printed = capsys.readouterr()
    assert line in printed.err
    assert printed.err.count("\n") == 2
    assert printed.out == ""


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a.b=2000", 2000),
        ("a.b = 1e3", 1e3),
        ("a=[1, 2.5]", [1, 2.5]),
        ("a={ mean = 2, spread = 1 }", {"mean": 2, "spread": 1}),
        ("a=true", True),
        ("a=leapfrog", "leapfrog"),
        ("a=#4fa3ff", "#4fa3ff"),
        ('a="1"', "1"),
        ("a=b=c", None),
    ],
)
def test_a_value_is_read_as_toml_and_a_word_needs_no_quotes(text: str, value: Any) -> None:
    if value is None:
        with pytest.raises(Exception, match="is not a value"):
            assignment(text)
    else:
        read = assignment(text)[1]
        assert (read, type(read)) == (value, type(value))


def test_ranges_of_frames_and_sizes() -> None:
    texts = ("1-48", "12", "10-", "-48")
    assert [frame_range(t) for t in texts] == [
        (1, 48),
        (12, 12),
        (10, None),
        (1, 48),
    ]
    assert picture_size("1920x1080") == [1920, 1080]
    assert ranges([1, 2, 3, 7, 9, 10]) == "1-3, 7, 9-10"
    assert ranges([]) == ""


def test_run_hands_on_its_options_and_prints_paths(
    studio: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = "run my.toml -o out --frames 2-9 --set water.emit.rate=5 --seed 7 --size 64x36"
    assert outcome(*arguments.split(), "--precision", "double", "--threads", "1") == 0
    assert studio.film["scene"].values == {
        "water.emit.rate": 5,
        "seed": 7,
        "precision": "double",
        "film.size": [64, 36],
    }
    assert (studio.film["folder"], studio.film["name"]) == (Path("out"), "my")
    assert (studio.film["first"], studio.film["last"]) == (2, 9)
    assert studio.threads == 1
    printed = capsys.readouterr()
    assert printed.out == "a.mp4\na.png\nframes\n"
    assert printed.err == "compiling (first run only)\nfirst picture: a.png\n"


def test_quiet_prints_paths_only(
    studio: SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    assert outcome("demo", "-q") == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("a.mp4\na.png\nframes\n", "")
    assert studio.film["folder"] == Path("sprinkler")


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (SimulationError("a particle became infinite"), 1),
        (SceneError([Problem((), "bad", 3)], "my.toml"), 2),
        (MissingExtra("pip install 'motes[usd]'"), 3),
        (OutputError("cannot write a.mp4: No space left on device."), 74),
        (PermissionError(13, "Permission denied", "a.mp4"), 74),
        (MemoryBudgetError("too many particles"), 75),
        (MemoryError(), 75),
        (KeyboardInterrupt(), 130),
        (MotesError("something"), 1),
        (RuntimeError("a\nbug"), 1),
    ],
)
def test_every_error_has_its_exit_code_and_no_traceback(
    studio: SimpleNamespace, capsys: pytest.CaptureFixture[str], error: BaseException, code: int
) -> None:
    studio.error = error
    assert outcome("run", "jet", "-q") == code
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "Traceback" not in printed.err
    assert 1 <= printed.err.count("\n") <= 2


@pytest.mark.parametrize("error", [KeyboardInterrupt(), SimulationError("infinite")])
def test_a_run_that_ends_early_says_how_to_go_on(
    studio: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    error: BaseException,
) -> None:
    FrameStore.create(tmp_path / "frames", MANIFEST).write(jet())
    studio.error = error
    outcome("run", "jet", "-o", str(tmp_path))
    assert f"Finished frames kept: 1. `motes render {tmp_path}`" in capsys.readouterr().err


def test_info_shows_kept_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = FrameStore.create(tmp_path / "frames", MANIFEST)
    for index in (1, 2, 5):
        store.write(jet(index))
    assert outcome("info", str(tmp_path)) == 0
    text = capsys.readouterr().out
    assert "1-2, 5 at 24 a second" in text
    assert "100 particles with position, velocity" in text
    assert outcome("info", str(tmp_path / "frames"), "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["count"], facts["digest"], facts["scene"]) == (3, "d1", {"title": "Jet"})
    assert facts["systems"]["water"]["position"] == {"dtype": "float32", "shape": [100, 3]}


def test_info_names_damaged_frames_and_shows_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = FrameStore.create(tmp_path / "frames", MANIFEST)
    for index in (1, 2):
        store.write(jet(index))
    data = bytearray(store.path(2).read_bytes())
    data[-1] ^= 1
    store.path(2).write_bytes(data)
    assert outcome("info", str(tmp_path), "--check") == 74
    printed = capsys.readouterr()
    assert "in frame 1" in " ".join(printed.out.split())
    assert printed.err.startswith(f"{store.path(2)} is damaged: ")
    assert printed.err.count("\n") == 1


@pytest.mark.parametrize("command", ["info", "render"])
def test_a_folder_without_frames_is_an_input_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert outcome(command, str(tmp_path)) == 74
    assert "holds no kept frames" in capsys.readouterr().err


def test_doctor_finds_this_machine_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome("doctor") == 0
    text = capsys.readouterr().out
    assert all(word in text for word in ("Python", "numba", "SIMD", "memory", "libx264"))
    assert outcome("doctor", "--json") == 0
    assert {"name", "value", "fix"} == set(json.loads(capsys.readouterr().out)[0])


def test_doctor_names_a_fix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("MOTES_CACHE", str(tmp_path / "file"))
    assert outcome("doctor") == 1
    assert "fix: Set MOTES_CACHE to a folder that can be written" in capsys.readouterr().out


def test_show_lists_the_catalog(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome("show") == 0
    overview = capsys.readouterr().out
    assert all(word in overview for word in ("force:", "drag", "integrate:", "rk4", "cone"))
    assert outcome("show", "force") == 0
    assert "wind [m/s]" in capsys.readouterr().out
    assert outcome("show", "integrate", "rk4") == 0
    assert "fourth order" in capsys.readouterr().out


def test_show_tells_all_of_a_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome("show", "force", "drag") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Stokes drag" in text
    assert "rate [kg/s] Force per speed relative to the air." in text
    assert "default 0.5; at least 0 kg/s; varies: particle" in text
    assert outcome("show", "force", "drag", "--json") == 0
    entry = json.loads(capsys.readouterr().out)
    assert entry["parameters"][0] == {
        "name": "rate",
        "unit": "kg/s",
        "default": 0.5,
        "range": "at least 0 kg/s",
        "scope": "particle",
        "help": "Force per speed relative to the air.",
    }


def test_show_knows_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert outcome("show", "forces") == 2
    assert 'Did you mean "force"?' in capsys.readouterr().err
    assert outcome("show", "force", "darg") == 2
    assert 'Did you mean "drag"?' in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="needs a shell")
def test_a_closed_pipe_ends_quietly() -> None:
    program = f"{sys.executable} -c 'from motes.cli import main; main()' show --json | head -c 1"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {program}"], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(os.name != "posix", reason="needs a shell that closes stdout")
def test_a_closed_stdout_is_no_fault() -> None:
    command = f"{sys.executable} -c 'from motes.cli import main; main()' new --help >&-"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


MISTAKES = (
    ("x = 1\ny = 1 / 0", "2: ZeroDivisionError: division by zero"),
    ("x = (", "1: SyntaxError: '(' was never closed"),
)


@pytest.mark.parametrize(("text", "line"), MISTAKES)
def test_a_mistake_in_a_file_of_components_is_one_line(
    text: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text)
    assert outcome("show", "--components", str(path)) == 2
    assert capsys.readouterr().err == f"{path}:{line}\n"
    assert outcome("show", "--components", str(tmp_path / "yours.py")) == 74
    assert capsys.readouterr().err.endswith("yours.py: there is no such file.\n")


def test_completion_offers_commands() -> None:
    environment = {**os.environ, "_MOTES_COMPLETE": "bash_complete"}
    environment |= {"COMP_WORDS": "motes r", "COMP_CWORD": "1"}
    done = subprocess_of(env=environment)
    assert done.stdout.split() == ["plain,run", "plain,render"]


def test_numbers_keep_three_digits() -> None:
    assert [rounded(x) for x in (0, 7, 999, 1000, 50_211, 812e6, 1.5e13)] == [
        "0",
        "7",
        "999",
        "1 k",
        "50.2 k",
        "812 M",
        "1.5e+04 G",
    ]
    done = Progress(done=1, total=2, particles=3000, particle_steps=10_000, simulating=0.01)
    assert work(done) == "1/2 frames, 3 k particles, 1 M particle-steps/s"
