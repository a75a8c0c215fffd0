"""A fault at any key of any scene is reported with its line, together with all others."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from itertools import islice
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich_scene import RICH

from motes.errors import Problem, SceneError
from motes.scene import gallery, gallery_text, loads
from motes.scene.lines import Path, json_lines, toml_lines
from motes.scene.write import toml

TEXTS = {"rich": RICH, **{name: gallery_text(name) for name in gallery()}}
KEY = re.compile(r"""(?P<quote>['"]?)(?P<key>[A-Za-z_]\w*)(?P=quote)(?=\s*=)""")
HEADER = re.compile(r"\[\[?[\w.]*?(?P<key>\w+)\]\]?")


def problems(text: str, format: Any = "toml") -> tuple[Problem, ...]:
    with pytest.raises(SceneError) as caught:
        loads(text, "scene", format)
    return caught.value.problems


def planted(text: str) -> Iterator[tuple[int, str, str]]:
    """Line, key and text of every scene that has one key renamed."""
    lines = text.split("\n")
    for i, line in enumerate(lines):
        if line.startswith(("#", "[not]")):
            continue  # A comment, and a line within a text.
        header = HEADER.match(line)
        for match in [header] if header else KEY.finditer(line):
            start, end = match.span("key")
            changed = f"{line[:start]}{match['key']}qq{line[end:]}"
            yield i + 1, match["key"], "\n".join([*lines[:i], changed, *lines[i + 1 :]])


@pytest.mark.parametrize("name", TEXTS)
def test_a_renamed_key_is_reported_at_its_line(name: str) -> None:
    """Every key of the rich scene, and every fifth one of each scene of the gallery."""
    first, stride = (0, 1) if name == "rich" else (len(name) % 5, 5)
    count = 0
    for line, key, text in islice(planted(TEXTS[name]), first, None, stride):
        faults = problems(text)
        if "not TOML" in str(faults):
            continue  # Tables of a list that has lost its header.
        found = {p.line for p in faults}
        if key == "type" and line not in found:
            # What is missing is reported where its table begins.
            before = text.split("\n")[: line - 1]
            line = max(i + 1 for i, other in enumerate(before) if other.startswith("["))
        assert line in found, (line, key, faults)
        count += 1
    assert count > (100 if name == "rich" else 3)


WRONG = ("nan", "1979-05-27", "{ nonsense = 1 }", '"#12"', "[[[1]]]")


@pytest.mark.parametrize(
    ("name", "first"),
    [
        *(("rich", first) for first in range(len(WRONG))),
        *((name, len(name) % len(WRONG)) for name in TEXTS if name != "rich"),
    ],
)
def test_a_wrong_value_is_reported_at_its_line(name: str, first: int) -> None:
    """Every key of the rich scene gets every wrong value, a third of the gallery's one of them."""
    lines = TEXTS[name].split("\n")
    count = 0
    for i, line in enumerate(lines):
        wrong = WRONG[(first + i * (name != "rich")) % len(WRONG)]
        match = re.match(r"""['"]?([\w.]+)['"]? = """, line)
        if match is None or (match[1] in ("title", "about") and wrong.startswith('"')):
            continue
        if name != "rich" and (first + i) % 3:
            continue
        text = "\n".join([*lines[:i], match[0] + wrong, *lines[i + 1 :]])
        try:
            tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            continue  # The first line of a value of several.
        assert i + 1 in {p.line for p in problems(text)}
        count += 1
    assert count > (50 if name == "rich" else 3)


def test_all_faults_are_reported_at_once() -> None:
    text = RICH.replace("rate = 200", "rat = 200").replace("g = [0, 0, -1.62]", "g = 1")
    text = text.replace("fps = 25", "fps = 0").replace('name = "sparks"', 'name = "water"')
    marks = [text.index("fps = 0"), text.index("g = 1"), text.index("rat = 200")]
    marks.append(text.rindex('name = "water"'))
    assert {p.line for p in problems(text)} == {text[:at].count("\n") + 1 for at in marks}


def test_json_faults_have_lines() -> None:
    text = loads(RICH).to_json()
    lines = text.split("\n")
    for i, line in enumerate(lines):
        match = re.match(r'( *)"(\w+)":', line)
        if match is None:
            continue
        changed = line.replace(f'"{match[2]}"', f'"{match[2]}qq"', 1)
        found = {
            p.line for p in problems("\n".join([*lines[:i], changed, *lines[i + 1 :]]), "json")
        }
        assert found & {i + 1, *around(lines, i)}, line


def around(lines: list[str], i: int) -> Iterator[int]:
    """Lines of the tables that a line is in, by their indentation."""
    indent = len(lines[i]) - len(lines[i].lstrip())
    for j in range(i, -1, -1):
        here = len(lines[j]) - len(lines[j].lstrip())
        if here < indent:
            indent = here
            yield j + 1


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, int]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, (*path, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from leaves(inner, (*path, i))
    elif isinstance(value, int):
        yield path, value


SCANNED = '''\
a = 1001 # = 5 [ ]
b.c.d = 1002
"quoted key" = 1003
'single.key' = 1004
"esc\\u0061ped" = 1005
e = [1006,
  1007, # a comment ] }
  [1008,
   1009]]
f = { x = 1010, y = { z = 1011 }, s = "}]" }
g = """text
[x] "" = 1
"""
h = \'\'\'
it\'s = [ \'\'\'
time = 1979-05-27T07:32:00.5Z
[table]
k = 1012
[table.inner]
k = 1013
[[list]]
k = 1014
sub = [{ k = 1015 }, { k = 1016 }]
[[list]]
k = 1017
[list.table]
k = 1018
[[list.list]]
k = 1019
[[list.list]]
k = -1020
  [ spaced . "out" ]
  k = +1021
  float = 1.5
'''


def test_the_scanner_finds_every_value_of_a_tricky_file() -> None:
    lines = toml_lines(SCANNED)
    found = list(leaves(tomllib.loads(SCANNED)))
    assert len(found) == 21
    for path, value in found:
        assert lines[path] == SCANNED[: SCANNED.index(str(abs(value)))].count("\n") + 1, path
    assert lines["list", 1] == SCANNED[: SCANNED.rindex("[[list]]")].count("\n") + 1


KEYS = st.text("ab .\"'\\\n[]{}=#é:,", max_size=5)
TREES = st.recursive(
    st.booleans() | st.floats(allow_nan=False, allow_infinity=False) | KEYS | st.integers(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=20,
)


def numbered(value: Any, next_number: Iterator[int]) -> Any:
    """The tree with a number of its own at every leaf that is not a text."""
    if isinstance(value, dict):
        return {key: numbered(v, next_number) for key, v in value.items()}
    if isinstance(value, list):
        return [numbered(v, next_number) for v in value]
    return value if isinstance(value, str) else next(next_number)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.dictionaries(KEYS, TREES, max_size=5))
def test_the_scanner_finds_every_value_of_any_file(tree: dict[str, Any]) -> None:
    document = numbered(tree, iter(range(77_000_000, 78_000_000)))
    as_json = json.dumps(document, indent=1)
    as_toml = toml(document)
    assert tomllib.loads(as_toml) == document
    for text, lines in ((as_json, json_lines(as_json)[0]), (as_toml, toml_lines(as_toml))):
        for path, value in leaves(document):
            assert lines[path] == text[: text.index(str(value))].count("\n") + 1


@pytest.mark.parametrize("key", ["systems", "sources"])
def test_a_system_that_there_is_not_is_reported_where_it_is_named(key: str) -> None:
    """Reading finds it, so that `motes check` does."""
    text = f"""[[interact]]
type = "gravity"
{key} = ["suns"]

[[system]]
name = "sun"
"""
    (found,) = problems(text)
    assert found.line == 3
    assert found.message == (
        'interaction "gravity": no system "suns". Did you mean "sun"? There are: sun.'
    )
