"""The catalog in words: plain data for the command line, the docs and an editor to print."""

from __future__ import annotations

import importlib
import inspect
from dataclasses import dataclass
from typing import Any

from motes.catalog import KINDS, Component, catalog, find, kinds
from motes.parameter import Parameter


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
    """One component, or one integrator."""

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
    """Everything in the catalog, kinds in the order of a time step."""
    return tuple(describe_kind(kind) for kind in KINDS)


def describe_kind(kind: str) -> Group:
    """All components of a kind.

    Raises:
        SceneError: there is no such kind.
    """
    names = _methods() if kind == "integrate" else catalog(kind)
    text = _text(importlib.import_module(f"motes.{kind}"))
    entries = tuple(describe_component(kind, name) for name in names)
    return Group(kind, _summary(text), text, entries)


def describe_component(kind: str, name: str) -> Entry:
    """One component with its parameters.

    Raises:
        SceneError: there is no such kind or component.
    """
    if kind == "integrate":
        from motes.integrate import method

        method(name)
        text = _text(importlib.import_module(f"motes.integrate.{name}"))
        return Entry(kind, name, _summary(text), text, (), f'integrator = "{name}"')
    if kind not in KINDS:
        catalog(kind)
    entry = find(kind, name)
    text = _text(entry)
    return Entry(kind, name, _summary(text), text, _fields(entry), _example(kind, name))


def _example(kind: str, name: str) -> str:
    if kind == "look":
        return f'look = {{ type = "{name}" }}'
    owner = "system." if kind in ("emit", "retire") else ""
    return f'[[{owner}{kind}]]\ntype = "{name}"'


def _methods() -> dict[str, Any]:
    from motes.integrate import methods

    return dict(methods())


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
