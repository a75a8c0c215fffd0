"""Write docs/reference and the tables of README.md from the catalog, the command line, the gallery.

python3 docs/generate.py            write what has changed
python3 docs/generate.py --check    write nothing; name the stale pages, with exit code 1 if any

A page says nothing that `motes show` does not know: texts, units and ranges are those that the
components declare.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from typing import Any

import click

from motes.catalog import KINDS, catalog, kinds
from motes.cli import COMMANDS, group
from motes.describe import DOCUMENT, Entry, Field, describe_kind
from motes.integrate import methods
from motes.scene import gallery_text
from motes.scene.gallery import gallery

ROOT = Path(__file__).resolve().parent.parent
REFERENCE = ROOT / "docs" / "reference"
README = ROOT / "README.md"

NOTICE = "<!-- Written by docs/generate.py. -->\n"
ACROSS = 3
"""Pictures side by side in the README's gallery."""

VARIES = (
    "**Varies** says how much a value may: `fixed`, a constant; `scene`, also a curve over time; "
    "`birth`, also drawn at random for each particle; `particle`, also a curve over life or speed. "
    "[The document](../the_document.md#numbers-that-vary) shows how each is written."
)

MENU_PAGES = {"integrator": "[a method](integrate.md)"}
"""Parameters with a menu too long for a cell, and the page that has it."""


def pages() -> dict[Path, str]:
    """Every generated page with its text."""
    found = {REFERENCE / f"{kind}.md": _kind(kind) for kind in (*KINDS, "integrate")}
    found[REFERENCE / "scene.md"] = _kind(DOCUMENT)
    found[REFERENCE / "commands.md"] = _commands()
    found[REFERENCE / "gallery.md"] = _gallery()
    found[README] = _readme(README.read_text("utf-8"))
    return found


def _kind(kind: str) -> str:
    """The page of one kind."""
    if kind == "integrate":
        return _page(_title(kind), *_methods())
    found = describe_kind(kind)
    parts = [] if kind == DOCUMENT else [_prose(found.text)]
    parts.append(VARIES)
    common: set[str] = set()
    if kind != DOCUMENT and (shared := kinds(kind).common_parameters):
        common = set(shared)
        fields = [field for field in found.entries[0].parameters if field.name in common]
        parts += [f"## Every {kinds(kind).noun}", _fields(fields)]
    for entry in found.entries:
        parts += _entry(entry, common)
    return _page(_title(kind), *parts)


def _title(kind: str) -> str:
    """Title of a kind's page: `Emitters`."""
    special = {DOCUMENT: "The scene and its tables", "integrate": "Methods of time stepping"}
    return special.get(kind) or f"{kinds(kind).noun.capitalize()}s"


def _entry(entry: Entry, common: set[str]) -> Iterator[str]:
    """One component or table: text, how a scene and Python name it, its own parameters."""
    yield f"## {entry.name}"
    yield _prose(entry.text)
    if entry.example:
        yield f"```toml\n{entry.example}\n```"
    if entry.kind != DOCUMENT:
        yield f"In Python: `motes.{entry.kind}.{catalog(entry.kind)[entry.name].__name__}`."
    if own := [field for field in entry.parameters if field.name not in common]:
        yield _fields(own)


def _fields(fields: Iterable[Field]) -> str:
    head = ("Parameter", "Default", "Unit", "Range", "Varies", "Meaning")
    return _table(head, (_facts(field) for field in fields))


def _facts(field: Field) -> tuple[str, ...]:
    """The row of a parameter; its range without the unit, which has a column."""
    bare = field.range.replace(f" {field.unit}", "") if field.unit else field.range
    allowed = MENU_PAGES.get(field.name, bare)
    default = _default(field.default)
    return f"`{field.name}`", default, field.unit, allowed, field.scope, _inline(field.help)


def _default(value: Any) -> str:
    if value is None:
        return "none"
    endless = isinstance(value, float) and value >= 1e6
    return f"`{value:g}`" if endless else f"`{json.dumps(value)}`"


def _methods() -> Iterator[str]:
    """A table of the methods that a scene can use."""
    yield (
        'A scene names its method once, `integrator = "rk4"`; a system may have its own. *Order* '
        "p means that the error falls with the p-th power of the step, *stages* how often a step "
        "asks for the forces. A *symplectic* method keeps the energy of orbits and springs from "
        "drifting."
    )
    texts = {entry.name: entry.text for entry in describe_kind("integrate").entries}
    rows = (
        (
            f"`{name}`",
            str(method.order),
            str(method.stages),
            "yes" if method.symplectic else "",
            _inline(texts[name]),
        )
        for name, method in methods().items()
    )
    yield _table(("Method", "Order", "Stages", "Symplectic", "When, and where it is from"), rows)


def _commands() -> str:
    """The page of the command line, from the commands themselves."""
    parts = [
        "Results go to standard output, progress and messages to standard error. Every command has "
        "`--help`; Tab completes words once `motes --help` has told your shell how.",
    ]
    for name in COMMANDS:
        command: click.Command = import_module(f"motes.cli.{name}").command
        context = click.Context(command, info_name=f"motes {name}")
        usage = " ".join(command.collect_usage_pieces(context))
        parts += [f"## motes {name}", f"```text\nmotes {name} {usage}\n```"]
        parts += [_paragraph(text) for text in cleandoc(command.help or "").split("\n\n")]
        options = [p for p in command.params if isinstance(p, click.Option)]
        records = [record for p in options if (record := p.get_help_record(context))]
        parts.append(_table(("Option", "Meaning"), ((f"`{o}`", _inline(h)) for o, h in records)))
    parts += ["## Exit codes", _exit_codes()]
    return _page("Commands", _inline(group.help or ""), *parts)


def _paragraph(text: str) -> str:
    """A paragraph of a command's help; after a line \\b its lines stand as they are."""
    if text.startswith("\b\n"):
        return f"```text\n{text[2:]}\n```"
    return _prose(text)


def _exit_codes() -> str:
    """The sentence about exit codes in the docstring of `motes.cli.main`."""
    from motes.cli import main

    sentence = re.search(r"Exit codes: (.*?)\.$", main.__doc__ or "", re.DOTALL | re.MULTILINE)
    assert sentence, "motes.cli.main no longer says its exit codes"
    return _inline(sentence[1]) + "."


def _scenes() -> Iterator[tuple[str, str, str]]:
    """Name, title and description of every scene of the gallery."""
    for name, title in gallery().items():
        yield name, title, str(tomllib.loads(gallery_text(name)).get("about", ""))


def _gallery() -> str:
    parts = [
        "Each runs from its name, `motes run sprinkler`, and is a commented file to start from, "
        "`motes new sprinkler my.toml`."
    ]
    for name, title, about in _scenes():
        parts += [
            f"## {_inline(title)}",
            f"![{_inline(title)}](../pictures/{name}.webp)",
            _prose(about),
            f"`motes run {name}` · [{name}.toml](../../src/motes/scenes/{name}.toml)",
        ]
    return _page("Gallery", *parts)


def _readme(text: str) -> str:
    """The README with its generated blocks as they should be."""
    for name, block in (("gallery", _pictures()), ("components", _overview())):
        begin, end = f"<!-- {name}: written by docs/generate.py -->\n", f"<!-- {name}: end -->"
        if text.count(begin) != 1 or text.count(end) != 1:
            raise SystemExit(f"README.md needs the lines {begin.strip()} and {end}, once each.")
        before, rest = text.split(begin)
        text = f"{before}{begin}\n{block}\n\n{end}{rest.split(end)[1]}"
    return text


def _pictures() -> str:
    """The gallery as a table of pictures, each with its title and name."""
    cells = [
        f"![{_inline(title)}](docs/pictures/{name}.webp)<br>{_inline(title)} · `{name}`"
        for name, title, _ in _scenes()
    ]
    cells += [""] * (-len(cells) % ACROSS)
    rows = [cells[i : i + ACROSS] for i in range(0, len(cells), ACROSS)]
    return _table(("",) * ACROSS, rows)


def _overview() -> str:
    """All components by kind, each with a link to its page."""
    rows = []
    for kind in (*KINDS, "integrate"):
        names = methods() if kind == "integrate" else catalog(kind)
        link = f"[{_title(kind)}](docs/reference/{kind}.md)"
        rows.append((link, ", ".join(f"`{name}`" for name in names)))
    return _table(("Kind", "Components"), rows)


def _page(title: str, *parts: str) -> str:
    return "\n\n".join((f"{NOTICE}# {title}", *(part for part in parts if part))) + "\n"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table; no table without rows."""
    head = tuple(head)
    lines = [_row(row) for row in rows]
    return "\n".join([_row(head), _row("---" for _ in head), *lines]) if lines else ""


def _row(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _prose(text: str) -> str:
    """Paragraphs of plain text as Markdown."""
    return "\n\n".join(_inline(paragraph) for paragraph in text.split("\n\n"))


def _inline(text: str) -> str:
    """Plain text on one line as Markdown: signs of a formula are no markup, code stays code."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(p if p.startswith("`") else re.sub(r"([*<])", r"\\\1", p) for p in parts)


def stale() -> Iterator[tuple[Path, str | None]]:
    """Pages that differ from what they should be, with that text; None: it should not be there."""
    wanted = pages()
    for path, text in wanted.items():
        if not path.is_file() or path.read_text("utf-8") != text:
            yield path, text
    for path in sorted(REFERENCE.glob("*.md")):
        if path not in wanted:
            yield path, None


def main(arguments: list[str]) -> int:
    """Write the stale pages, or with --check name them; the exit code."""
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 2
    found = list(stale())
    for path, text in found:
        name = path.relative_to(ROOT).as_posix()
        if arguments:
            print(f"{name} is stale: run python3 docs/generate.py", file=sys.stderr)
        elif text is None:
            path.unlink()
            print(f"{name} removed")
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8", newline="\n")
            print(f"{name} written")
    return 1 if arguments and found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
