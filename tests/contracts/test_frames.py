"""A kept frame reads back exactly, or says in one line why it does not."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from jet import MANIFEST, jet

from motes.errors import OutputError
from motes.files import STALE, sweep, written_whole
from motes.frame import Frame
from motes.record.encoding import FORMAT, MAGIC, decode, encode
from motes.record.frames import FrameStore, Manifest, digest_of


def assert_same(a: Frame, b: Frame) -> None:
    assert (a.time, a.index) == (b.time, b.index)
    assert list(a.systems) == list(b.systems)
    for name, columns in a.systems.items():
        assert list(columns) == list(b[name])
        for key, column in columns.items():
            assert b[name][key].dtype == column.dtype
            assert b[name][key].shape == column.shape
            assert b[name][key].tobytes() == column.tobytes()


any_column = arrays.arrays(
    st.one_of(
        arrays.boolean_dtypes(),
        arrays.integer_dtypes(endianness="?"),
        arrays.unsigned_integer_dtypes(endianness="?"),
        arrays.floating_dtypes(endianness="?"),
        arrays.complex_number_dtypes(endianness="?"),
    ),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
)
any_systems = st.dictionaries(
    st.text(max_size=8), st.dictionaries(st.text(max_size=8), any_column, max_size=4), max_size=3
)


@given(systems=any_systems, moment=st.floats(allow_nan=False), index=st.integers(1, 10**9))
@settings(max_examples=200, deadline=None)
def test_any_numbers_of_any_shape_read_back_bit_for_bit(systems, moment, index) -> None:
    frame = Frame(moment, index, systems)
    assert_same(frame, decode(b"".join(encode(frame)), Path("x.frame")))


def test_a_store_gives_back_what_was_written(tmp_path: Path) -> None:
    store = FrameStore.create(tmp_path / "out" / "frames", MANIFEST)
    for index in (3, 1, 120_000):
        store.write(jet(index, rows=index % 7))
    again = FrameStore.open(store.folder)
    assert again.manifest == MANIFEST
    assert again.numbers() == [1, 3, 120_000]
    for frame in again:
        assert_same(jet(frame.index, rows=frame.index % 7), frame)
    assert again.size() == sum(again.path(number).stat().st_size for number in again.numbers())


def test_only_numbers_can_be_kept() -> None:
    with pytest.raises(TypeError, match=r"water\.name must hold numbers"):
        list(encode(Frame(0.0, 1, {"water": {"name": np.array(["a"])}})))


def test_the_name_of_a_system_is_likely_misspelt() -> None:
    with pytest.raises(KeyError, match=r'no system "watr"\. Did you mean "water"'):
        jet()["watr"]


WHOLE = b"".join(encode(jet(rows=20)))


@given(st.integers(0, len(WHOLE) - 1))
@settings(max_examples=100, deadline=None)
def test_a_truncated_frame_is_refused(length: int) -> None:
    with pytest.raises(OutputError, match=r"^x\.frame is (damaged|not a frame)[^\n]*$"):
        decode(WHOLE[:length], Path("x.frame"))


@given(st.integers(0, len(WHOLE) - 1), st.integers(1, 255))
@settings(max_examples=200, deadline=None)
def test_a_flipped_byte_is_noticed(position: int, change: int) -> None:
    damaged = bytearray(WHOLE)
    damaged[position] ^= change
    with pytest.raises(OutputError, match=r"^x\.frame is (damaged|not a frame)[^\n]*$"):
        decode(bytes(damaged), Path("x.frame"))


@given(st.binary(max_size=200))
@settings(max_examples=200, deadline=None)
def test_a_foreign_file_is_refused(data: bytes) -> None:
    for content in (data, MAGIC + data):
        with pytest.raises(OutputError):
            decode(content, Path("x.frame"))


def test_trailing_bytes_are_noticed() -> None:
    with pytest.raises(OutputError, match="longer than its header says"):
        decode(WHOLE + b"0", Path("x.frame"))


def test_a_frame_under_another_number_is_noticed(tmp_path: Path) -> None:
    store = FrameStore.create(tmp_path, MANIFEST)
    store.write(jet(1)).rename(store.path(2))
    with pytest.raises(OutputError, match="it holds frame 1"):
        store.read(2)


def test_a_future_frame_is_refused_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motes.record.encoding.FORMAT", FORMAT + 1)
    data = b"".join(encode(jet()))
    monkeypatch.undo()
    with pytest.raises(OutputError, match="format 2, and this motes reads up to 1"):
        decode(data, Path("x.frame"))


def test_a_future_manifest_is_refused_with_what_to_do(tmp_path: Path) -> None:
    FrameStore.create(tmp_path, MANIFEST)
    path = tmp_path / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "format": 9, "new": 1}))
    with pytest.raises(OutputError, match=r"format 9, .*A newer motes \(0\.1\.0\) wrote it"):
        FrameStore.open(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"format": 1}', '{"format": "x"}', "\xff"])
def test_a_foreign_manifest_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(OutputError, match="is not a manifest of kept frames"):
        FrameStore.open(tmp_path)


def test_a_folder_without_frames_says_so(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="holds no kept frames"):
        FrameStore.open(tmp_path / "nowhere")


def test_the_same_digest_goes_on_and_another_begins_anew(tmp_path: Path) -> None:
    FrameStore.create(tmp_path, MANIFEST).write(jet(1))
    assert FrameStore.create(tmp_path, MANIFEST).numbers() == [1]
    other = Manifest("jet", {"title": "Jet"}, "d2", 24.0, "0.1.0")
    assert FrameStore.create(tmp_path, other).numbers() == []


def test_runs_of_two_scenes_in_one_folder_are_noticed(tmp_path: Path) -> None:
    """The one that began first ends; a frame that it still wrote is not taken for the other's."""
    first = FrameStore.create(tmp_path, MANIFEST)
    first.write(jet(1))
    other = replace(MANIFEST, digest="d2")
    second = FrameStore.create(tmp_path, other)
    with pytest.raises(OutputError, match="taken by a run of another scene"):
        first.write(jet(2))
    second.path(2).write_bytes(b"".join(encode(jet(2), MANIFEST.digest)))
    with pytest.raises(OutputError, match=r"00002\.frame belongs to another film"):
        second.read(2)
    assert list(second.faults()) == [2]


def test_faults_name_the_frames_that_are_damaged(tmp_path: Path) -> None:
    """Lengths show at once; a flipped bit shows where the frame is read whole."""
    store = FrameStore.create(tmp_path, MANIFEST)
    for index in (1, 2, 3, 4):
        store.write(jet(index))
    assert store.faults(whole=True) == {}
    cut, flipped = store.path(2), bytearray(store.path(3).read_bytes())
    cut.write_bytes(cut.read_bytes()[:-7])
    flipped[-5] ^= 1
    store.path(3).write_bytes(flipped)
    store.path(4).unlink()
    store.path(4).mkdir()
    assert {n: text.split(":")[0] for n, text in store.faults().items()} == {
        2: f"{cut} is damaged", 4: f"cannot read {store.path(4)}",
    }  # fmt: skip
    assert "7 bytes are missing at its end" in store.faults()[2]
    assert list(store.faults(whole=True)) == [2, 3, 4]


@pytest.mark.parametrize(
    "fields",
    [
        {"name": "../jet"}, {"name": ""}, {"name": 3}, {"scene": []}, {"fps": "24"}, {"fps": 0.0},
        {"digest": 1}, {"scripts": {"solid/bump": 3}}, {"scripts": 7},
    ],
)  # fmt: skip
def test_a_manifest_with_a_foreign_field_is_refused(tmp_path: Path, fields: Any) -> None:
    path = FrameStore.create(tmp_path, MANIFEST).folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))
    with pytest.raises(OutputError, match="is not a manifest of kept frames"):
        FrameStore.open(tmp_path)


def test_a_digest_does_not_depend_on_the_order_of_keys() -> None:
    assert digest_of({"a": 1, "b": 2.5}) == digest_of({"b": 2.5, "a": 1}) != digest_of({"a": 1})


def test_a_failed_write_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(TypeError), written_whole(path) as file:
        file.write("not bytes")  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_only_old_leftovers_are_swept(tmp_path: Path) -> None:
    old, young = tmp_path / ".a.01234567.part.txt", tmp_path / ".b.01234567.part.txt"
    for leftover in (old, young):
        leftover.write_text("half")
    long_ago = time.time() - 2 * STALE
    os.utime(old, (long_ago, long_ago))
    sweep(tmp_path)
    assert list(tmp_path.iterdir()) == [young]


def test_a_file_where_a_folder_should_be_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(OutputError, match=r"^cannot make the folder .*file: [^\n]+\.$"),
        written_whole(tmp_path / "file" / "a.txt"),
    ):
        pass


@pytest.mark.skipif(os.name != "posix", reason="needs kill -9")
def test_a_killed_writer_loses_no_finished_frame(tmp_path: Path) -> None:
    chance = random.Random(20)
    verified = kills = 0
    while kills < 20 or (verified <= 20 and kills < 200):  # A busy machine writes little meanwhile.
        kills += 1
        with subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("jet.py")), str(tmp_path)],
            stdout=subprocess.PIPE,
        ) as writer:
            assert writer.stdout is not None
            assert writer.stdout.readline() == b"ready\n"
            time.sleep(chance.uniform(0.0, 0.06))
            writer.send_signal(signal.SIGKILL)
        store = FrameStore.open(tmp_path)
        assert store.numbers() == list(range(1, len(store.numbers()) + 1))
        for number in store.numbers()[verified:]:
            assert_same(jet(number, rows=3000), store.read(number))
        verified = len(store.numbers())
    assert verified > 20
