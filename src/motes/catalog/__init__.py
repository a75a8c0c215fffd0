"""The catalog: every component, found by its folder, an entry point or the decorator.

A component is a class in a file: `force/drag.py` is `type = "drag"` in a `[[force]]`. The decorator
`@component` reads its parameters and kernels; nobody keeps a list. A folder states what its
components have in common as a `Kind`.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

from motes.catalog.parameter import Color, Flag, Integer, Number, Parameter, Vector, quantity
from motes.catalog.source import attribute_docs, class_source
from motes.errors import Problem, SceneError, likely, path_of

if TYPE_CHECKING:
    from motes.control.control import Control

__all__ = [
    "Color",
    "Component",
    "Flag",
    "Integer",
    "Kind",
    "Number",
    "Vector",
    "catalog",
    "component",
    "kinds",
    "quantity",
]

KINDS = ("emit", "force", "flow", "interact", "solid", "retire", "look")
"""Folders that hold components, in the order of a time step."""


@dataclass(frozen=True)
class Kind:
    """What the components of one folder have in common.

    `scope` is the most that their parameters may vary; a parameter may state less. `kernels` names
    the functions of which a component must have at least one. `common` is a class whose parameters
    every component of the kind gets; what it means is written once, in the engine.
    """

    name: str
    noun: str
    scope: str
    kernels: tuple[str, ...] = ()
    common: type | None = None
    by_kernel: Mapping[str, type] = field(default_factory=dict, hash=False)
    """In place of `common`, for components that define a kernel of this name."""

    @property
    def common_parameters(self) -> dict[str, Parameter]:
        """The parameters that every component of this kind has."""
        return _parameters(self.common, self.scope) if self.common else {}

    def shared(self, part: type) -> type | None:
        """The class whose parameters a component gets."""
        for kernel, common in self.by_kernel.items():
            if kernel in vars(part):
                return common
        return self.common

    def members(self) -> dict[str, type[Component]]:
        """All components of this kind by name."""
        return catalog(self.name)


class Component:
    """A component with its values: what an entry of a scene becomes.

    Values are checked when it is made; it never changes afterwards.
    """

    kind: Kind
    type: str
    parameters: Mapping[str, Parameter]
    needs: tuple[str, ...]
    own: frozenset[str]
    """Names of the parameters that the component itself declares, without the common ones."""

    name: str
    values: Mapping[str, Control]

    def __init__(self, *, name: str | None = None, **values: Any) -> None:
        checked, problems = self.check(values)
        if problems:
            raise SceneError(problems, source="")
        object.__setattr__(self, "name", name or self.type)
        object.__setattr__(self, "values", checked)

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> tuple[dict[str, Control], list[Problem]]:
        """Turn plain values into controls; what is wrong comes back as problems, all of it."""
        checked: dict[str, Control] = {}
        problems: list[Problem] = []
        for key in values:
            if key not in cls.parameters:
                problems.append(Problem((key,), cls._unknown(key)))
        for key, parameter in cls.parameters.items():
            try:
                checked[key] = parameter.control(values.get(key, parameter.default))
            except ValueError as fault:
                where = f'{cls.kind.noun} "{cls.type}"'
                problems.append(Problem((key, *path_of(fault)), f"{where}: {fault}"))
        return checked, problems

    @classmethod
    def _unknown(cls, key: str) -> str:
        own_first = sorted(cls.parameters.values(), key=lambda p: p.name not in cls.own)
        menu = ", ".join(p.short() for p in own_first) or "none"
        noun = f'{cls.kind.noun} "{cls.type}"'
        return f'{noun} has no parameter "{key}".{likely(key, cls.parameters)} It takes {menu}.'

    def __getattr__(self, key: str) -> Any:
        values = self.__dict__.get("values", {})
        if key in values:
            return values[key].document()
        raise AttributeError(f'{type(self).__name__} has no attribute "{key}"')

    def __setattr__(self, key: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen; make a changed copy of the scene")

    def __eq__(self, other: object) -> bool:
        return (
            type(self) is type(other)
            and isinstance(other, Component)
            and self.name == other.name
            and self.values == other.values
        )

    def __hash__(self) -> int:
        return hash((type(self), self.name))

    def __repr__(self) -> str:
        values = ", ".join(f"{key}={value!r}" for key, value in self.document().items())
        return f"{type(self).__name__}({values})"

    def document(self) -> dict[str, Any]:
        """The component as an entry of a scene file, without values equal to their defaults."""
        entry: dict[str, Any] = {"type": self.type}
        if self.name != self.type:
            entry["name"] = self.name
        for key, parameter in self.parameters.items():
            value = self.values[key]
            if value != parameter.control(parameter.default):
                entry[key] = value.document()
        return entry

    @classmethod
    def kernel(cls, name: str) -> Callable[..., Any] | None:
        """The component's kernel of that name, as a plain Python function."""
        return cls.__dict__.get(name)

    @classmethod
    def source(cls) -> str:
        """The component's source text, part of what identifies a simulation."""
        return class_source(cls)

    @classmethod
    def help(cls) -> dict[str, str]:
        """One line of help for each parameter, from the text under its declaration."""
        return {**_documented(cls.kind.shared(cls)), **attribute_docs(cls)}


C = TypeVar("C")


@dataclass
class _Registry:
    """Components that decorators have declared, by kind and type."""

    entries: dict[str, dict[str, type[Component]]] = field(default_factory=dict)


_registry = _Registry()


@dataclass_transform(kw_only_default=True, field_specifiers=(quantity,))
def component(cls: type[C] | None = None, *, kind: str = "", name: str = "") -> Any:
    """Declare a class as a component.

    In a folder of the catalog the file's path says kind and type; elsewhere name them:
    `@component(kind="force", name="tide")`. A class of the same kind and name replaces an earlier
    one, so that a notebook cell may be run again.
    """
    if cls is None:
        return lambda c: component(c, kind=kind, name=name)
    parts = cls.__module__.split(".")
    kind = kind or (parts[-2] if len(parts) > 1 else "")
    if kind not in KINDS:
        raise SceneError(
            f'component {cls.__name__}: kind "{kind}" is none of {", ".join(KINDS)}. '
            'In a script, write @component(kind="force", name="tide").'
        )
    name = name or parts[-1]
    family = kinds(kind)
    body = {k: v for k, v in vars(cls).items() if k not in ("__dict__", "__weakref__")}
    own = _parameters(cls, family.scope)
    for key in own:
        del body[key]
    made: Any = type(cls.__name__, (Component,), body)
    made.kind = family
    made.type = name
    made.own = frozenset(own)
    common = family.shared(cls)
    made.parameters = {**(_parameters(common, family.scope) if common else {}), **own}
    made.needs = tuple(body.get("needs", ()))
    if family.kernels and not any(made.kernel(k) for k in family.kernels):
        raise SceneError(
            f'{family.noun} "{name}" ({cls.__name__}) has no kernel. '
            f"It must define {' or '.join(family.kernels)}."
        )
    _registry.entries.setdefault(kind, {})[name] = made
    return made


def _parameters(cls: type, scope: str) -> dict[str, Parameter]:
    """Parameters of a class body, named, in order, with the kind's scope where unstated."""
    return {
        key: value.named(key, scope)
        for base in reversed(cls.__mro__)
        for key, value in vars(base).items()
        if isinstance(value, Parameter)
    }


def _documented(cls: type | None) -> dict[str, str]:
    """Help of the parameters of a class and those that it stands on."""
    bases = [base for base in reversed(cls.__mro__) if base is not object] if cls else []
    return {key: text for base in bases for key, text in attribute_docs(base).items()}


@cache
def kinds(name: str) -> Kind:
    """The kind that a folder declares."""
    found = importlib.import_module(f"motes.{name}").KIND
    assert isinstance(found, Kind)
    return found


@cache
def _load(kind: str) -> None:
    """Import every file of a kind's folder and every plugin, once."""
    package = importlib.import_module(f"motes.{kind}")
    for module in pkgutil.iter_modules(package.__path__):
        if not module.name.startswith("_"):
            importlib.import_module(f"motes.{kind}.{module.name}")
    _load_plugins()


@cache
def _load_plugins() -> None:
    """Import the modules that other packages name in the entry-point group `motes`."""
    from importlib.metadata import entry_points

    for entry in entry_points(group="motes"):
        entry.load()


def catalog(kind: str) -> dict[str, type[Component]]:
    """All components of a kind by type, in alphabetical order."""
    if kind not in KINDS:
        hint = f"{likely(kind, KINDS)} Kinds: {', '.join(KINDS)}."
        raise SceneError(f'no kind "{kind}".{hint}', source="")
    _load(kind)
    return dict(sorted(_registry.entries.get(kind, {}).items()))


def find(kind: str, type: str) -> type[Component]:
    """One component by kind and type, without importing the others where its file is known."""
    known = _registry.entries.get(kind, {})
    if type not in known and type.isidentifier() and not type.startswith("_"):
        module = f"motes.{kind}.{type}"
        if importlib.util.find_spec(module) is not None:
            importlib.import_module(module)
    if type not in _registry.entries.get(kind, {}):
        menu = catalog(kind)
        if type not in menu:
            hint = f"{likely(type, menu)} There are: {', '.join(menu)}."
            raise SceneError(f'no {kinds(kind).noun} "{type}".{hint}', source="")
    return _registry.entries[kind][type]


def attribute(kind: str) -> Callable[[str], type[Component]]:
    """A module `__getattr__` that gives components by class name: `motes.force.Gravity`."""

    def lookup(name: str) -> type[Component]:
        if name.startswith("_"):
            raise AttributeError(name)
        menu = {entry.__name__: entry for entry in catalog(kind).values()}
        if name not in menu:
            hint = f"{likely(name, menu)} There are: {', '.join(menu)}."
            raise AttributeError(f'no {kinds(kind).noun} "{name}" in motes.{kind}.{hint}')
        return menu[name]

    return lookup


def _forget(kind: str, type: str) -> None:
    """Take a component out of the catalog (for tests that declare one)."""
    _registry.entries.get(kind, {}).pop(type, None)
