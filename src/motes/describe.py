"""The catalog in words: plain data for the command line, the docs and an editor to print."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import dataclass
from typing import Any

from motes import integrate
from motes.catalog import KINDS, Component, catalog, find, kinds
from motes.catalog.parameter import Parameter
from motes.errors import SceneError, likely

DOCUMENT = "document"
"""Kind of the tables that a scene itself has."""

TABLES = {
    "scene": "",
    "film": "[film]",
    "camera": "[camera]",
    "sky": "[sky]",
    "periodic": "[periodic]",
    "system": '[[system]]\nname = "water"',
}
"""Tables of a scene, and how each begins in TOML."""


@dataclass(frozen=True)
class Field:
    """One parameter, as a person reads it."""

    name: str
    unit: str
    default: Any
    range: str
    """Allowed values in words: `at least 0 kg/s`, or the menu."""

    scope: str
    """How much it may vary: fixed, scene, birth or particle."""

    help: str


@dataclass(frozen=True)
class Entry:
    """One component, integrator, or table of a scene."""

    kind: str
    name: str
    summary: str
    """The first sentence of its text."""

    text: str
    parameters: tuple[Field, ...]
    example: str
    """How a scene names it, in TOML."""


@dataclass(frozen=True)
class Group:
    """All that the catalog holds of one kind."""

    kind: str
    summary: str
    text: str
    entries: tuple[Entry, ...]


def describe() -> tuple[Group, ...]:
    """Everything that a scene can hold: its tables, then kinds in the order of a time step."""
    return tuple(describe_kind(kind) for kind in (DOCUMENT, *KINDS, "integrate"))


def describe_kind(kind: str) -> Group:
    """All components of a kind, or the tables of a scene.

    Raises:
        SceneError: there is no such kind.
    """
    if kind == DOCUMENT:
        text, names = "The tables of a scene.", list(TABLES)
    elif kind == "integrate":
        text, names = _text(importlib.import_module("motes.integrate")), list(integrate.names())
    else:
        _known(kind)
        text, names = _text(importlib.import_module(f"motes.{kind}")), list(catalog(kind))
    entries = tuple(describe_entry(kind, name) for name in names)
    return Group(kind, _summary(text), text, entries)


def describe_entry(kind: str, name: str) -> Entry:
    """One component, integrator, or table of a scene, with its parameters.

    Raises:
        SceneError: there is no such kind, or nothing of that name in it.
    """
    if kind == DOCUMENT:
        return _table(name)
    if kind == "integrate":
        integrate.method(name)
        text = _text(importlib.import_module(f"motes.integrate.{name}"))
        return Entry(kind, name, _summary(text), text, (), f'integrator = "{name}"')
    _known(kind)
    entry = find(kind, name)
    text = _text(entry)
    return Entry(kind, name, _summary(text), text, _fields(entry), _example(kind, name))


def _known(kind: str) -> None:
    if kind not in KINDS:
        menu = (*KINDS, *TABLES)
        hint = f"{likely(kind, menu)} There are: {', '.join(menu)}."
        raise SceneError(f'no kind "{kind}".{hint}', source="")


def _table(name: str) -> Entry:
    from motes import scene

    sections: dict[str, Any] = {table: getattr(scene, table.capitalize()) for table in TABLES}
    if name not in sections:
        menu = ", ".join(TABLES)
        hint = f"{likely(name, TABLES)} It has {menu}."
        raise SceneError(f'a scene has no table "{name}".{hint}', source="")
    section = sections[name]
    help = section.help()
    fields = tuple(field(p, help.get(key, "")) for key, p in section.parameters.items())
    text = _text(section)
    return Entry(DOCUMENT, name, _summary(text), text, fields, TABLES[name])


def _example(kind: str, name: str) -> str:
    if kind == "look":
        return f'look = {{ type = "{name}" }}'
    owner = "system." if kind in ("emit", "retire") else ""
    return f'[[{owner}{kind}]]\ntype = "{name}"'


def _fields(entry: type[Component]) -> tuple[Field, ...]:
    """The component's own parameters, then those that all of its kind have."""
    help = entry.help()
    shared = kinds(entry.kind.name).common_parameters
    order = sorted(entry.parameters, key=lambda name: name in shared)
    return tuple(field(entry.parameters[name], help.get(name, "")) for name in order)


def field(parameter: Parameter, help: str) -> Field:
    """A parameter in words."""
    allowed = ", ".join(parameter.menu) if parameter.menu else parameter.range()
    default = parameter.default
    if isinstance(default, tuple):
        default = list(default)
    return Field(parameter.name, parameter.unit, default, allowed, parameter.scope, help)


def _text(thing: Any) -> str:
    return inspect.cleandoc(thing.__doc__ or "")


def _summary(text: str) -> str:
    """The first sentence, on one line, or the first clause that a colon ends where it is long."""
    line = " ".join(text.split("\n\n")[0].split())
    return line.split(". ")[0].rstrip(".") + "." if line else ""
