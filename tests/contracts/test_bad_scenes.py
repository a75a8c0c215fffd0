"""No file makes a traceback, a hang or a vague line."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich_scene import RICH

import motes
from motes.errors import SceneError
from motes.scene import Scene, System, from_document, gallery_text, load, loads
from motes.scene.limits import SIZE

LIMIT = 1.0
"""Time of the processor that a file may take [s]; waiting for other programs does not count."""


def read(content: str | bytes, format: Any = "toml") -> str:
    """What reading says, or nothing for a good scene; it must be quick."""
    begun = time.process_time()
    lines: list[str] = []
    try:
        loads(content, "bad", format)
    except SceneError as error:
        lines = error.lines()
    assert time.process_time() - begun < LIMIT
    assert all(line.isprintable() for line in lines)
    return "\n".join(lines)


SEEDS = [
    (RICH.encode(), "toml"),
    (gallery_text("sprinkler").encode(), "toml"),
    (loads(RICH).to_json().encode(), "json"),
]
PIECES = [
    b"[", b"]", b"{", b"}", b"=", b'"', b"'", b",", b".", b"#", b"\n", b"\r", b"\0", b"\xff", b"-",
    b'"""', b"nan", b"inf", b"1e400", b"1e30", b"9" * 500, b"1e-320", b"[[system]]", b"true",
    b'"\\ud800"', b"1979-05-27", b"null", b"0x10", b"name", b"type", b"over", b"\xf0\x9f\x8e\x86",
]  # fmt: skip


def mutated(data: bytes, rng: random.Random) -> bytes:
    """A file with one to four wounds."""
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(data) + 1)
        end = min(at + rng.choice((1, 1, 2, 5, 30, 200)), len(data))
        part = data[at:end]
        kind = rng.randrange(6)
        if kind == 0 and part:
            data = data[:at] + bytes([part[0] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + data[end:]
        elif kind == 2:
            data = data[:at] + part + part + data[end:]
        elif kind == 3:
            data = data[:at] + rng.choice(PIECES) + data[at:]
        elif kind == 4:
            data = data[:at] + rng.choice(PIECES) + data[end:]
        else:
            other = rng.randrange(len(data) + 1)
            data = data[:other] + part + data[other:]
    return data


@pytest.mark.parametrize("block", range(8))
def test_mutated_files_give_scenes_or_problems(block: int) -> None:
    rng = random.Random(block)
    said = 0
    for _ in range(100):
        data, format = rng.choice(SEEDS)
        said += bool(read(mutated(data, rng), format))
    assert said > 60


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["time", "life", "#ffffff", "cone", "drag", "bezier", "extend", "points"]),
    lambda inner: st.lists(inner, max_size=5)
    | st.dictionaries(
        st.sampled_from(
            ["type", "name", "rate", "over", "keys", "stops", "mean", "spread", "low", "high",
             "normal", "choice", "at", "count", "every", "times", "interpolation", "after", "x"]
        ),
        inner,
        max_size=4,
    ),
    max_leaves=12,
)  # fmt: skip


@settings(max_examples=200, derandomize=True, deadline=LIMIT * 1000)
@given(address=st.sampled_from(loads(RICH).addresses()), value=VALUES)
def test_any_value_anywhere_gives_a_scene_or_problems(address: str, value: Any) -> None:
    try:
        scene = loads(RICH).with_values({address: value})
    except SceneError:
        return
    assert from_document(scene.document()) == scene


@settings(max_examples=200, derandomize=True, deadline=LIMIT * 1000)
@given(
    st.dictionaries(
        st.sampled_from(["system", "force", "film", "camera", "seed", "look", "emit", "solid"]),
        VALUES | st.lists(st.dictionaries(st.sampled_from(["name", "type", "emit"]), VALUES)),
        max_size=4,
    )
)
def test_any_document_gives_a_scene_or_problems(document: dict[str, Any]) -> None:
    for build in (from_document, lambda d: Scene(**d), lambda d: System("a", **d)):
        with suppress(SceneError):
            build(document)


BIG = SIZE - 100
HOSTILE: dict[str, Callable[[], str]] = {
    "brackets": lambda: "a=" + "[" * BIG,
    "empty lists": lambda: "a=[" + "[]," * (BIG // 3) + "]",
    "numbers": lambda: "a=[" + "1," * (BIG // 2) + "]",
    "keys": lambda: "".join(f"k{i}=1\n" for i in range(BIG // 9)),
    "unknown types": lambda: "".join(f"[[force]]\ntype='x{i}'\n" for i in range(4000)),
    "tables": lambda: "[[force]]\n" * (BIG // 10),
    "dotted key": lambda: "a" + ".a" * (BIG // 2 - 2) + "=1",
    "dotted header": lambda: "[" + "a." * (BIG // 2 - 2) + "a]",
    "inline depth": lambda: ("a={" + "b." * 60) * 60 + "c=1" + "}" * 60,
    "digits": lambda: "seed=" + "9" * BIG,
    "hexadecimal": lambda: "seed=0x" + "f" * BIG,
    "open text": lambda: 'a="""' + "x" * BIG,
    "backslashes": lambda: 'a="""' + "\\" * BIG,
    "quotes": lambda: '"""\n' * (BIG // 4),
    "apostrophes": lambda: "'''\n'" * (BIG // 5),
    "long key": lambda: "k" * BIG + "=1",
    "long name": lambda: '[[system]]\nname="' + "a" * BIG + '"',
    "long type": lambda: '[[force]]\ntype="' + "a" * BIG + '"',
    "line ends": lambda: "\n" * BIG,
    "same names": lambda: '[[system]]\nname="a"\n' + "[[system.force]]\ntype='drag'\n" * 1600,
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_end_quickly_in_short_lines(name: str) -> None:
    said = read(HOSTILE[name]())
    assert len(said) < 150_000
    assert said or name == "line ends"


@pytest.mark.parametrize("text", ['{"a":' * 99, "[" * 99, '{"force":[' + "{}," * 99999 + "{}]}"])
def test_hostile_json_ends_quickly(text: str) -> None:
    assert read(text, "json")


EXACT: dict[str, tuple[str | bytes, list[str]]] = {
    "unknown parameter": (
        '[[force]]\ntype = "drag"\nrat = 1',
        ['bad:3: force "drag" has no parameter "rat". Did you mean "rate"? '
         "It takes rate [kg/s], wind [m/s], stiff."],
    ),
    "range": (
        '[[force]]\ntype = "drag"\nrate = -1.0',
        ['bad:3: force "drag": rate = -1 kg/s must be at least 0 kg/s.'],
    ),
    "unknown type": (
        '[[solid]]\ntype = "plan"',
        ['bad:2: no solid "plan". Did you mean "plane"? There are: box, plane, sphere.'],
    ),
    "no type": (
        "[[solid]]\nrestitution = 1.0",
        ["bad:1: solid: a solid needs a type. There are: box, plane, sphere."],
    ),
    "unknown key": (
        "[film]\nfp = 24",
        ['bad:2: film has no "fp". Did you mean "fps"? It takes fps [1/s], size [pixels], shutter, '
         "exposure [EV], tone, bloom, background."],
    ),
    "choice": (
        'precision = "singel"',
        ['bad:1: precision must be one of single, double, not "singel". Did you mean "single"?'],
    ),
    "scope": (
        '[[system]]\nname = "a"\nlife = { over = "speed", keys = [[0, 1]] }',
        ['bad:3: system "a": life cannot vary over speed. It takes a number or '
         '{ over = "time", keys = [[t, value], ...] } or { mean = m, spread = s }, '
         "{ normal = [mean, sigma] }, { choice = [a, b] }."],
    ),
    "twice in a list": (
        '[[force]]\ntype = "drag"\n[[force]]\ntype = "drag"',
        ['bad:3: two in force have the name "drag"; give one of them a name of its own.'],
    ),
    "twice in a system": (
        '[[system]]\nname = "a"\n[[system.emit]]\ntype = "point"\nname = "x"\n'
        '[[system.force]]\ntype = "drag"\nname = "x"',
        ['bad:8: system "a": one in emit and one in force have the name "x"; '
         "give one of them a name of its own."],
    ),
    "system like a force": (
        '[[system]]\nname = "gravity"\n[[force]]\ntype = "gravity"',
        ['bad:3: one in system and one in force have the name "gravity"; '
         "give one of them a name of its own."],
    ),
    "reserved name": (
        '[[system]]\nname = "film"',
        ['bad:2: the name "film" has a meaning of its own; take another.'],
    ),
    "name": (
        '[[system]]\nname = "a b"',
        ['bad:2: system: a name must be a word of letters, digits, _ and -, not "a b".'],
    ),
    "no name": ("[[system]]\nlife = 1",
                ['bad:1: system: a name is missing, such as name = "water".']),
    "not a list": ("[system]\nlife = 1", ["bad:1: system must be a list of tables [[system]]."]),
    "not a table": ("film = 3", ["bad:1: film must be a table [film]."]),
    "infinite": ("duration = inf", ["bad:1: duration = inf must be finite."]),
    "odd size": ("[film]\nsize = [641, 360]",
                 ["bad:2: film: size = [641, 360] pixels must be two even numbers."]),
    "whole": ("seed = 1.5", ["bad:1: seed must be a whole number, not 1.5."]),
    "bytes": (b"seed = 1\na = \xff\xfe",
              ["bad:2: this is not UTF-8 text; save the file as UTF-8."]),
    "nul": ("seed = 1\n\0", ["bad:2: a NUL character; this is not a text file."]),
    "size": ("#" * (SIZE + 1), ["bad: it is larger than 0.5 MB, the most that a scene may be."]),
    "syntax": ("seed = 1\nseed 2", ["bad:2: not TOML: expected '=' after a key in a key/value pair "
                                    "(column 6)."]),
    "word": ("integrator = rk4", ["bad:1: not TOML: a value must be a number, true, false, a "
                                  '"text" in quotes, [a, list] or { a = table } (column 14).']),
    "twice": ("seed = 1\nseed = 2", ["bad:2: not TOML: this key is here a second time."]),
}  # fmt: skip


@pytest.mark.parametrize("name", EXACT)
def test_faults_are_said_in_these_words(name: str) -> None:
    text, lines = EXACT[name]
    said = read(text).split("\n")
    assert [line.split(" (column")[0] for line in said] == [
        line.split(" (column")[0] for line in lines
    ]


def test_a_key_twice_in_json_is_an_error() -> None:
    assert read('{"film": {"fps": 24,\n"fps": 25}}', "json") == (
        'bad:2: the key "fps" is here a second time.'
    )


def test_a_scene_that_is_not_there_gives_the_menu(tmp_path: Path) -> None:
    with pytest.raises(
        SceneError, match=r'no scene "sprinklr"\. Did you mean "sprinkler"\? The ga'
    ):
        load("sprinklr")
    with pytest.raises(SceneError, match=r"no file .*The gallery has: .*sprinkler"):
        load(tmp_path / "nothing.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(SceneError, match=r"^a folder, not a scene: "):
        load(tmp_path / "folder.toml")


def test_faults_in_python_have_no_file() -> None:
    with pytest.raises(SceneError) as caught:
        motes.emit.Cone(rat=2, angle=-1)
    assert [line.split(" It takes")[0] for line in caught.value.lines()] == [
        'emitter "cone" has no parameter "rat". Did you mean "rate"?',
        'emitter "cone": angle = -1 degrees must be at least 0 degrees and at most 180 degrees.',
    ]
    with pytest.raises(SceneError, match='emitter "cone" cannot stand in force'):
        System("a", force=[motes.emit.Cone()])


def test_a_name_that_is_no_text_is_one_fault() -> None:
    with pytest.raises(SceneError) as error:
        loads("[[system]]\nname = 3\n")
    (line,) = error.value.lines()
    assert line == "scene:2: system: a name must be a word of letters, digits, _ and -, not 3."


def test_a_folder_in_place_of_a_scene_is_called_one(tmp_path: Path) -> None:
    for name in ("dir", "dir.toml"):
        (tmp_path / name).mkdir()
        with pytest.raises(SceneError, match=r"^a folder, not a scene: "):
            load(tmp_path / name)


def test_a_folder_of_the_name_of_a_scene_does_not_hide_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sprinkler").mkdir()
    assert load("sprinkler").title == "Sprinkler"


def test_half_a_surrogate_pair_has_its_line() -> None:
    with pytest.raises(SceneError) as error:
        loads('{\n"title": "\\ud83d\\ude00",\n"about": "\\ud800"}', format="json")
    assert error.value.problems[0].line == 3


def test_the_name_of_a_scene_is_not_a_scene() -> None:
    for taking in (motes.Simulation, motes.Studio, lambda s: motes.film(s, "nowhere")):
        with pytest.raises(TypeError, match=r'Write motes\.load\("sprinkler"\)'):
            taking("sprinkler")  # type: ignore[arg-type]
