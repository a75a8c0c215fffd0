"""Scripts that no test runs, benchmarks and pictures of the pages, still find what they import."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(
    path
    for folder in ("benchmarks", "docs", "examples", "tools")
    for path in (ROOT / folder).glob("*.py")
)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_a_script_imports_from_motes_is_there(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "motes":
            module = import_module(node.module or "")
            for name in (each.name for each in node.names):
                assert hasattr(module, name) or find_spec(f"{node.module}.{name}"), name
