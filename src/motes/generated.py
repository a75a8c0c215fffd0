"""Python text that the project writes: run, and kept where the compiler and tracebacks find it."""

from __future__ import annotations

import hashlib
import linecache
from typing import Any

from motes.errors import OutputError
from motes.files import written_whole
from motes.jit import cache_folder


def executed(source: str, scope: dict[str, Any]) -> dict[str, Any]:
    """Run the text of a module in a scope, kept where the compiler and tracebacks find it."""
    exec(compile(source, _keep(source), "exec"), scope)
    return scope


def _keep(source: str) -> str:
    """Write the text beside the kernels, so that debuggers and tracebacks can show it."""
    name = hashlib.sha256(source.encode()).hexdigest()[:24]
    path = cache_folder() / "modules" / f"{name}.py"
    try:
        if not path.is_file() or path.stat().st_size != len(source.encode()):
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with written_whole(path, lasting=False) as file:
                file.write(source.encode())
    except (OSError, OutputError):
        pass  # Only a convenience: the text also stands in linecache.
    linecache.cache[str(path)] = (len(source), None, source.splitlines(True), str(path))
    return str(path)
