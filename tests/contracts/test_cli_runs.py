"""The command line with the engine: a small film from beginning to end, and one that is stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from motes.frame import Frame
from motes.production import open_frames
from motes.rehearsal import Rehearsal, frame_of, main
from motes.scene import load, loads

av = pytest.importorskip("av")

SCENE = """
title = "Jet"
duration = 0.5
[film]
size = [64, 36]
[[force]]
type = "gravity"
[[system]]
name = "water"
[[system.emit]]
type = "cone"
rate = 400
"""


def command(*arguments: Any) -> list[str]:
    return [sys.executable, "-c", "from motes.cli import main; main()", *map(str, arguments)]


def run(*arguments: Any, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(*arguments), cwd=cwd, capture_output=True, text=True, timeout=120)


def length(path: Path) -> tuple[int, int, int]:
    """Frames, width and height of a film."""
    with av.open(str(path)) as container:
        frames = list(container.decode(video=0))
    return len(frames), frames[0].width, frames[0].height


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "jet.toml"
    path.write_text(SCENE)
    return path


def test_a_scene_becomes_a_film_and_is_drawn_again(scene: Path, tmp_path: Path) -> None:
    done = run("run", scene, "-o", "out", "--set", "water.emit.rate=800", cwd=tmp_path)
    assert (done.returncode, done.stdout.split()) == (
        0,
        [str(Path("out", name)) for name in ("jet.mp4", "jet.png", "frames")],
    ), done.stderr
    out = tmp_path / "out"
    assert length(out / "jet.mp4") == (12, 64, 36)
    frame = open_frames(out).read(12)
    assert (frame.time, len(frame["water"]["id"])) == (11 / 24, int(800 * 11 / 24))

    done = run(
        "render", "out", "--size", "80x48", "--frames", "3-7", "--format", "webp", cwd=tmp_path
    )
    assert (done.returncode, done.stdout.split()[0]) == (0, str(Path("out", "jet.webp")))
    assert (out / "jet.webp").is_file()
    done = run("render", "out", "--size", "80x48", "--frames", "3-7", cwd=tmp_path)
    assert length(out / "jet.mp4") == (5, 80, 48)

    facts = json.loads(run("info", "out", "--json", cwd=tmp_path).stdout)
    assert (facts["frames"], facts["title"]) == ("1-12", "Jet")
    done = run("render", "out", "--frames", "40-", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (
        2,
        "frames: no frames 40-: the film has frames 1-12.\n",
    )


def test_mistakes_in_a_scene_are_lines_on_stderr(scene: Path, tmp_path: Path) -> None:
    scene.write_text(SCENE.replace("rate = 400", "rat = 400\nspeed = -1e400"))
    for words in (["run", "jet.toml"], ["check", "jet.toml"]):
        done = run(*words, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("jet.toml:") == done.stderr.count("\n") >= 1
        assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == [scene]
    scene.write_text(SCENE)
    done = run("run", "jet.toml", "--set", "watr.rate=1", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_a_new_scene_is_good_and_is_not_overwritten(tmp_path: Path) -> None:
    assert run("new", "sprinkler", "my.toml", cwd=tmp_path).stdout == "my.toml\n"
    checked = json.loads(run("check", "my.toml", "--json", cwd=tmp_path).stdout)
    assert checked == [{"scene": "my.toml", "problems": []}]
    text = (tmp_path / "my.toml").read_text()
    assert load(tmp_path / "my.toml") == load("sprinkler")
    (tmp_path / "my.toml").write_text("mine")
    done = run("new", "sprinkler", "my.toml", cwd=tmp_path)
    assert (done.returncode, "--force" in done.stderr) == (2, True)
    assert (tmp_path / "my.toml").read_text() == "mine"
    assert run("new", "sprinkler", "my.toml", "--force", cwd=tmp_path).returncode == 0
    assert (tmp_path / "my.toml").read_text() == text
    assert run("new", "sprinklr", cwd=tmp_path).returncode == 2


def test_the_schema_is_json(tmp_path: Path) -> None:
    assert json.loads(run("schema", cwd=tmp_path).stdout)["type"] == "object"


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_run_keeps_whole_frames_that_make_a_film(
    scene: Path, tmp_path: Path, ending: signal.Signals
) -> None:
    with subprocess.Popen(
        command("run", scene, "-o", "out", "--set", "duration=1000"),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        wanted = tmp_path / "out" / "frames" / "00005.frame"
        limit = time.monotonic() + 100
        while not wanted.exists() and process.poll() is None and time.monotonic() < limit:
            time.sleep(0.02)
        process.send_signal(ending)
        out, err = process.communicate(timeout=60)
    assert out == ""
    if ending == signal.SIGINT:
        assert process.returncode == 130
        assert "`motes render out` makes a film of them.\n" in err
        assert err.endswith("\nStopped.\n")
    store = open_frames(tmp_path / "out")
    count = len(store.numbers())
    assert store.numbers() == list(range(1, count + 1))
    assert all(isinstance(frame, Frame) for frame in store)
    done = run("render", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert length(tmp_path / "out" / "jet.mp4")[0] == count >= 5


def test_a_rehearsal_draws_every_system(monkeypatch: pytest.MonkeyPatch) -> None:
    import io

    scene = loads(SCENE)
    assert frame_of(scene).count == 1
    monkeypatch.setattr(sys, "stdin", io.StringIO(json.dumps(scene.document())))
    main()


def test_a_rehearsal_that_cannot_begin_is_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with Rehearsal(loads(SCENE)) as rehearsal:
        rehearsal.begin()
        rehearsal.wait()


HUNT = """
title = "Hunt"
duration = 0.5
step = 0.05
integrator = "semi_implicit_euler"
film = { size = [64, 36] }
[[interact]]
type = "capture"
hunters = ["cat"]
radius = 0.25
[[system]]
name = "cat"
emit = [{ type = "point", burst = [{ count = 1 }], position = [-0.5, 0, 0], velocity = [4, 0, 0] }]
force = [{ type = "cruise", speed = 4 }]
[[system]]
name = "mice"
emit = [{ type = "line", burst = [{ count = 9 }], length = 3.2, position = [1.6, 0.1, 0] }]
force = [{ type = "cruise", speed = 0 }]
"""


def test_captures_are_told(tmp_path: Path) -> None:
    """A run says how many were caught, `motes info` when; parts of a film tell each of its own."""
    (tmp_path / "hunt.toml").write_text(HUNT)
    done = run("run", "hunt.toml", "-o", "whole", "--no-film", cwd=tmp_path)
    told = json.loads(run("info", "whole", "--json", cwd=tmp_path).stdout)["captures"]
    assert len(told) > 2
    assert f"{len(told)} caught" in done.stderr
    assert all(abs(one["place"][0] - (4 * one["time"] - 0.5)) < 0.25 + 4 * 0.05 for one in told)
    assert len({one["prey"] for one in told}) == len(told)
    shown = run("info", "whole", cwd=tmp_path).stdout
    assert f"{len(told)}, the first at {told[0]['time']:.3g} s" in " ".join(shown.split())
    for part in ("1-6", "7-12"):
        run("run", "hunt.toml", "-o", "parts", "--no-film", "--frames", part, cwd=tmp_path)
    assert json.loads(run("info", "parts", "--json", cwd=tmp_path).stdout)["captures"] == told


BUMP = """
import motes
from motes.kernel import kernel

@motes.component(kind="solid", name="bump")
class Bump:
    \'\'\'A ball.\'\'\'

    radius: motes.Number = motes.quantity(0.5, "m")

    @kernel
    def distance(p, x, y, z):
        return (x * x + y * y + z * z) ** 0.5 - p.radius
"""


def test_a_solid_of_somebodys_own_file_is_drawn_only_where_the_file_is_named(
    scene: Path, tmp_path: Path
) -> None:
    """Frames name the file that declares what they need; it is run where the user says so."""
    script = tmp_path / "bump.py"
    script.write_text(BUMP)
    with scene.open("a") as file:
        file.write('\n[[solid]]\ntype = "bump"\n')
    quick = ("--frames", "1-2", "--size", "32x18", "-q")
    assert 'no solid "bump"' in run("check", scene, cwd=tmp_path).stderr
    made = run("run", scene, "-o", "out", *quick, "--components", "bump.py", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    refused = run("render", "out", "-q", cwd=tmp_path)
    assert refused.returncode == 2
    assert refused.stderr == (
        f'the solid "bump" was declared in {script}. Add --components {script}, which runs that '
        "file, or call motes.redraw in it.\n"
    )
    assert str(script) in run("info", "out", cwd=tmp_path).stdout
    drawn = run("render", "out", "-q", "--components", "bump.py", cwd=tmp_path)
    assert drawn.returncode == 0, drawn.stderr
