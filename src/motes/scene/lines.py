"""Where each key of a scene file stands: neither tomllib nor json tells the lines.

The scanner reads text that its parser has accepted already, so it need not look for faults.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field

Path = tuple[str | int, ...]

STRING = r'"""(?:\\.|[^\\])*?"{3,5}' + r"|'''.*?'{3,5}" + r'|"(?:\\.|[^"\\\n])*"' + r"|'[^'\n]*'"
"""A text of TOML or JSON, with its quotes; use with re.DOTALL."""

_TOKEN = re.compile(
    rf"(?P<text>{STRING})|(?P<comment>\#[^\n]*)|(?P<newline>\n)|(?P<mark>[\[\]{{}}=,.:])"
    r"|(?P<word>[^\s\[\]{}=,.:\#\"']+)",
    re.DOTALL,
)


def line_of(lines: dict[Path, int], path: Path) -> int | None:
    """Line of a path, or of the nearest table around it that has one."""
    for end in range(len(path), 0, -1):
        if path[:end] in lines:
            return lines[path[:end]]
    return None


def toml_lines(text: str) -> dict[Path, int]:
    """Line, from 1, of each key, table and list entry of a valid TOML text."""
    return _Toml(_Tokens(text)).document()


def json_lines(text: str) -> tuple[dict[Path, int], list[Path]]:
    """The same of a valid JSON text, and the paths that occur twice."""
    reader = _Json(_Tokens(text))
    reader.value(())
    return reader.lines, reader.twice


@dataclass(frozen=True)
class _Token:
    text: str
    kind: str
    line: int


END = _Token("", "end", 0)


class _Tokens:
    """Tokens with their lines, one ahead."""

    def __init__(self, text: str) -> None:
        self._rest = self._all(text)
        self.next = END
        self.take()

    def _all(self, text: str) -> Iterator[_Token]:
        line = 1
        for match in _TOKEN.finditer(text):
            kind, token = str(match.lastgroup), match[0]
            if kind != "comment":
                yield _Token(token, kind, line)
            line += token.count("\n")

    def take(self) -> _Token:
        """The next token; the one behind it becomes `next`."""
        taken, self.next = self.next, next(self._rest, END)
        return taken

    def skip(self, text: str) -> bool:
        """Take the next token if it is `text`."""
        if self.next.text == text and self.next is not END:
            self.take()
            return True
        return False

    def skip_lines(self) -> None:
        """Take line ends."""
        while self.next.kind == "newline":
            self.take()


@dataclass
class _Toml:
    tokens: _Tokens
    lines: dict[Path, int] = field(default_factory=dict)
    counts: dict[Path, int] = field(default_factory=dict)
    """How many entries each list of tables has so far."""

    def document(self) -> dict[Path, int]:
        table: Path = ()
        tokens = self.tokens
        tokens.skip_lines()
        while tokens.next is not END:
            line = tokens.next.line
            if tokens.skip("["):
                table = self._header(line)
            else:
                self._pair(table)
            tokens.skip_lines()
        return self.lines

    def _header(self, line: int) -> Path:
        is_list = self.tokens.skip("[")
        keys = self._keys()
        self.tokens.skip("]")
        self.tokens.skip("]")
        path = self._within((), keys[:-1], line)
        path = (*path, keys[-1])
        if is_list:
            self.lines.setdefault(path, line)
            self.counts[path] = self.counts.get(path, 0) + 1
            path = (*path, self.counts[path] - 1)
        self.lines[path] = line
        return path

    def _within(self, path: Path, keys: list[str], line: int) -> Path:
        """Go down through tables, in lists of them to the last."""
        for key in keys:
            path = (*path, key)
            self.lines.setdefault(path, line)
            if path in self.counts:
                path = (*path, self.counts[path] - 1)
        return path

    def _keys(self) -> list[str]:
        """The names of a dotted key."""
        found = [self._key()]
        while self.tokens.skip("."):
            found.append(self._key())
        return found

    def _key(self) -> str:
        token = self.tokens.take()
        if token.kind == "text":
            return str(tomllib.loads(f"key = {token.text}")["key"])
        return token.text

    def _pair(self, table: Path) -> None:
        line = self.tokens.next.line
        keys = self._keys()
        self.tokens.skip("=")
        path = (*self._within(table, keys[:-1], line), keys[-1])
        self.lines[path] = line
        self._value(path)

    def _value(self, path: Path) -> None:
        tokens = self.tokens
        self.lines.setdefault(path, tokens.next.line)
        if tokens.skip("["):
            self._items(path)
        elif tokens.skip("{"):
            tokens.skip_lines()
            while tokens.next is not END and not tokens.skip("}"):
                self._pair(path)
                tokens.skip_lines()
                tokens.skip(",")
                tokens.skip_lines()
        else:
            while tokens.next is not END and tokens.next.text not in (",", "]", "}", "\n"):
                tokens.take()

    def _items(self, path: Path) -> None:
        tokens, i = self.tokens, 0
        tokens.skip_lines()
        while tokens.next is not END and not tokens.skip("]"):
            self._value((*path, i))
            tokens.skip_lines()
            tokens.skip(",")
            tokens.skip_lines()
            i += 1


@dataclass
class _Json:
    tokens: _Tokens
    lines: dict[Path, int] = field(default_factory=dict)
    twice: list[Path] = field(default_factory=list)

    def value(self, path: Path) -> None:
        tokens, i = self.tokens, 0
        tokens.skip_lines()
        self.lines.setdefault(path, tokens.next.line)
        opening = tokens.take().text
        if opening not in ("[", "{"):
            # Numbers such as 1.5 are several tokens.
            while tokens.next is not END and tokens.next.text not in (",", "]", "}", "\n"):
                tokens.take()
            return
        tokens.skip_lines()
        while tokens.next is not END and tokens.next.text not in ("]", "}"):
            if opening == "{":
                self._member(path)
            else:
                self.value((*path, i))
                i += 1
            tokens.skip_lines()
            tokens.skip(",")
            tokens.skip_lines()
        tokens.take()

    def _member(self, path: Path) -> None:
        key = self.tokens.take()
        inner = (*path, json.loads(key.text, strict=False))
        if inner in self.lines:
            self.twice.append(inner)
        self.lines[inner] = key.line
        self.tokens.skip_lines()
        self.tokens.skip(":")
        self.value(inner)
