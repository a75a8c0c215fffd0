"""`motes show`: what a scene can be made of."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from motes.cli.options import components_option, json_option

if TYPE_CHECKING:
    from motes.describe import Entry, Field, Group


def _complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    from motes.catalog import KINDS
    from motes.describe import TABLES, describe_kind

    kind = ctx.params.get("kind")
    if param.name == "kind":
        names: Iterable[str] = (*KINDS, *TABLES)
    else:
        names = (entry.name for entry in describe_kind(kind).entries) if kind in KINDS else ()
    return [name for name in names if name.startswith(incomplete)]


@click.command(short_help="List kinds, components and their parameters.")
@click.argument("kind", required=False, shell_complete=_complete)
@click.argument("name", required=False, shell_complete=_complete)
@components_option
@json_option
def command(kind: str | None, name: str | None, as_json: bool) -> None:
    """Show what a scene can be made of.

    \b
    motes show               all kinds and their components, and the scenes of the gallery
    motes show force         all forces
    motes show force drag    one force and its parameters
    motes show camera        a table of the scene: scene, film, camera, sky or system
    """
    from motes.describe import DOCUMENT, TABLES, describe, describe_entry, describe_kind

    if kind in TABLES and name is None:
        kind, name = DOCUMENT, kind
    if kind is None:
        found: Any = describe()
        lines = _overview(found)
    elif name is None:
        found = describe_kind(kind)
        lines = _group(found)
    else:
        found = describe_entry(kind, name)
        lines = _entry(found)
    if as_json:
        data = [asdict(each) for each in found] if isinstance(found, tuple) else asdict(found)
        click.echo(json.dumps(data, indent=2, ensure_ascii=False))
    else:
        click.echo(lines)


def _overview(groups: tuple[Group, ...]) -> str:
    from motes.scene import gallery

    text = click.HelpFormatter(max_width=100)
    for group in groups:
        _heading(text, group.kind, group.summary)
        _list(text, ((entry.name, entry.summary) for entry in group.entries))
    _heading(text, "scenes", "The gallery: motes run NAME.")
    _list(text, gallery().items())
    return text.getvalue().rstrip()


def _group(group: Group) -> str:
    text = click.HelpFormatter(max_width=100)
    text.write(group.text + "\n")
    for entry in group.entries:
        _heading(text, entry.name, entry.summary)
        _list(text, ((_short(field), field.help) for field in entry.parameters))
    return text.getvalue().rstrip()


def _entry(entry: Entry) -> str:
    text = click.HelpFormatter(max_width=100)
    text.write(entry.text + "\n")
    if entry.parameters:
        text.write("\n")
        _list(text, ((_short(field), _long(field)) for field in entry.parameters))
    if entry.example:
        text.write("\nIn a scene:\n")
    text.write("".join(f"  {line}\n" for line in entry.example.splitlines()))
    return text.getvalue().rstrip()


def _heading(text: click.HelpFormatter, name: str, summary: str) -> None:
    text.write_paragraph()
    text.write_text(f"{name}: {summary}")


def _list(text: click.HelpFormatter, rows: Iterable[tuple[str, str]]) -> None:
    rows = list(rows)
    if rows:
        with text.indentation():
            text.write_dl(rows)


def _short(field: Field) -> str:
    return f"{field.name} [{field.unit}]" if field.unit else field.name


def _long(field: Field) -> str:
    """Help, default, range and scope of a parameter."""
    facts = [f"default {_value(field.default)}", field.range, f"varies: {field.scope}"]
    return f"{field.help} ({'; '.join(fact for fact in facts if fact)})"


def _value(value: Any) -> str:
    return "none" if value is None else json.dumps(value)
