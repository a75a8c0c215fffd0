"""Python files of somebody's own that declare components: which they are, and running them."""

from __future__ import annotations

import runpy
import traceback
from pathlib import Path
from types import FunctionType

from motes.errors import OutputError, Problem, SceneError


def script_of(cls: type) -> str | None:
    """The file in which a class was declared, "" at a prompt or in a notebook, None in motes."""
    if cls.__module__.startswith("motes."):
        return None
    names = [f.__code__.co_filename for f in vars(cls).values() if isinstance(f, FunctionType)]
    files = [path for path in map(Path, names) if path.suffix == ".py" and path.is_file()]
    # A notebook's kernel names its cells like files, which are not there.
    return str(files[0].resolve()) if files else ""


def include(path: Path) -> None:
    """Run a Python file, so that the components that it declares join the catalog.

    Its `__name__` is the file's own, so that what stands under `if __name__ == "__main__":` is
    not run.

    Raises:
        OutputError: it cannot be read.
        SceneError: it raises an exception; the line is that of the file.
    """
    if not path.is_file():
        raise OutputError(f"cannot read {path}: there is no such file.")
    try:
        runpy.run_path(str(path), run_name=path.stem)
    except Exception as error:
        raise _fault(path, error) from error


def _fault(path: Path, error: Exception) -> SceneError:
    lines = [
        at.lineno for at in traceback.extract_tb(error.__traceback__) if at.filename == str(path)
    ]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    what = error.msg if isinstance(error, SyntaxError) else str(error)
    kind = "" if isinstance(error, SceneError) else f"{type(error).__name__}: "
    return SceneError([Problem((), f"{kind}{what}", line)], source=str(path))
