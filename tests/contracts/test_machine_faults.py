"""What the compiler refuses, what it leaves to Numba, what it keeps."""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager

import pytest
from both_ways import WITH_COMPILER, compiled

import motes.jit
from motes.errors import OutputError, SceneError
from motes.generated import executed
from motes.jit import jit

pytestmark = WITH_COMPILER


def test_what_is_outside_the_language_is_said_in_one_line():
    def strange(x):
        y = [x]
        return y

    def unknown(x):
        return x + nowhere  # noqa: F821

    def early(x):
        for i in range(3):
            if i > x:
                return y  # noqa: F821
            y = i  # noqa: F841
        return x

    for function, word in (
        (strange, "List"),
        (unknown, '"nowhere"'),
        (early, "before it has a value"),
    ):
        with pytest.raises(SceneError) as caught:
            compiled(function)(1.0)
        message = str(caught.value)
        assert word in message
        assert function.__name__ in message
        assert "test_machine_faults.py:" in message
        assert "\n" not in message


def test_outside_of_scenes_numba_compiles_the_rest():
    @jit
    def unusual(x):
        return [x, 2 * x][1]

    assert unusual(2.0) == 4.0
    assert unusual.foreign


def test_a_kept_kernel_is_not_compiled_again_and_a_damaged_one_is(tmp_path, monkeypatch):
    monkeypatch.setenv("MOTES_CACHE", str(tmp_path))
    told: list[str] = []
    monkeypatch.setattr(motes.jit, "_listener", told.append)

    def half(x):
        return 0.5 * x

    assert compiled(half)(3.0) == 1.5
    assert compiled(half)(5.0) == 2.5
    assert told == ["half"]
    (file,) = (tmp_path / "kernels").glob("half-*")
    file.write_bytes(file.read_bytes()[:-50])
    assert compiled(half)(7.0) == 3.5
    assert told == ["half", "half"]


def test_text_that_cannot_be_kept_runs_all_the_same(tmp_path, monkeypatch):
    """A cache of somebody else may be read only."""

    @contextmanager
    def refused(path, **_):
        raise OutputError(f"cannot write {path}: Permission denied.")
        yield

    monkeypatch.setenv("MOTES_CACHE", str(tmp_path))
    monkeypatch.setattr("motes.generated.written_whole", refused)
    assert executed("answer = 6 * 7\n", {})["answer"] == 42


def test_a_film_needs_no_numba(tmp_path):
    """Kernels of simulation and drawing are inside the language; Numba takes longer to import."""
    program = (
        "import sys, motes; scene = motes.load('sprinkler').with_values({'film.size': [96, 64]});"
        f"motes.film(scene, {str(tmp_path)!r}, last=3); print('numba' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stderr
