"""Entries of a scene that name a component: `type`, perhaps `name`, and the component's values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

from motes.catalog import Component, catalog, find, kinds
from motes.errors import Problem, SceneError
from motes.scene.names import word
from motes.scene.section import fault, faults


@dataclass(frozen=True)
class Entry:
    """Marks a field that holds components of one kind: `Annotated[Component, Entry("force")]`."""

    kind: str

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def read(self, value: Any) -> Component:
        """The component that an entry stands for.

        Raises ValidationError with all that is wrong in it, each at its key.
        """
        noun = kinds(self.kind).noun
        if isinstance(value, Component):
            if value.kind.name != self.kind:
                raise fault(f'{value.kind.noun} "{value.name}" cannot stand in {self.kind}.')
            if problems := word(value.name, (), f'{noun} "{value.type}": '):
                raise faults(problems, value)
            return value
        if not isinstance(value, Mapping):
            raise fault(f"{self.kind}: {_a(noun)} must be a table with a type. {self._menu()}")
        name = value.get("name")
        values = {key: v for key, v in value.items() if key not in ("type", "name")}
        type = value.get("type")
        if not isinstance(type, str):
            message = f"{self.kind}: {_a(noun)} needs a type. {self._menu()}"
            raise faults([Problem(("type",) if "type" in value else (), message)], value)
        try:
            found = find(self.kind, type)
        except SceneError as error:
            raise faults([Problem(("type",), p.message) for p in error.problems], value) from None
        _, problems = found.check(values)
        problems += word(name, ("name",), f'{noun} "{type}": ')
        if problems:
            raise faults(problems, value)
        return found(name=name, **values)

    def _menu(self) -> str:
        return f"There are: {', '.join(catalog(self.kind))}."


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"
