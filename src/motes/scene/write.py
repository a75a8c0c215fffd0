"""Writing a scene: TOML as people write it, tables for parts and one line for each value."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml(document: Mapping[str, Any]) -> str:
    """The text of a plain document: own values first, then tables, then lists of tables."""
    return "\n".join(_table(document, "")).strip() + "\n"


def json_text(document: Mapping[str, Any]) -> str:
    """The same in JSON."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _table(table: Mapping[str, Any], prefix: str) -> list[str]:
    """Lines of a table; within it, only parts of the document get headers of their own."""
    plain = {k: v for k, v in table.items() if not _is_part(k, v, prefix)}
    lines = [f"{_key(key)} = {_value(value)}" for key, value in plain.items()]
    for key, value in table.items():
        if key in plain:
            continue
        name = f"{prefix}{_key(key)}"
        for entry in [value] if isinstance(value, Mapping) else value:
            header = f"[{name}]" if isinstance(value, Mapping) else f"[[{name}]]"
            lines += ["", header, *_table(entry, f"{name}.")]
    return lines


def _is_part(key: str, value: Any, prefix: str) -> bool:
    """Whether a value stands under a header: sections, systems, and the lists of both."""
    if isinstance(value, Mapping):
        return not prefix
    tables = isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)
    return tables and prefix in ("", "system.")


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(text: str) -> str:
    """A basic string; JSON's escapes are TOML's, which forbids one more character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(k)} = {_value(v)}' for k, v in value.items())} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(v) for v in value)}]"
    return json.dumps(value, allow_nan=False)
