"""What every part of the document is: a frozen model whose values are declared parameters.

A part declares its values as a component does, with `quantity`. Pydantic gives the structure and
finds all faults at once; the catalog's parameters check the values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, ClassVar, Self, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo, field_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from motes.catalog.parameter import Parameter
from motes.catalog.source import attribute_docs
from motes.control.constant import Setting
from motes.control.control import Control
from motes.errors import Problem, SceneError, likely, path_of


def fault(message: str) -> PydanticCustomError:
    """An error that Pydantic collects with its place, and that says exactly `message`."""
    return PydanticCustomError("fault", "{message}", {"message": message})


def faults(problems: Sequence[Problem], value: Any) -> ValidationError:
    """Several errors within one value of a document, each at its own place."""
    details = [InitErrorDetails(type=fault(p.message), loc=p.path, input=value) for p in problems]
    return ValidationError.from_exception_data("scene", details)


class Section(BaseModel):
    """A table of the document. It never changes; `Scene.with_values` makes a changed copy."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", arbitrary_types_allowed=True, validate_default=True
    )

    noun: ClassVar[str]
    """How errors name it."""

    parameters: ClassVar[dict[str, Parameter]]
    """Its values by name, in the order of their declaration."""

    def __init__(self, **values: Any) -> None:
        with collected(type(self), values, source=""):
            super().__init__(**values)

    # A table within a table is then checked by Pydantic itself, which knows where it is.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        cls.parameters = {
            name: field.default.named(name, "fixed")
            for name, field in cls.model_fields.items()
            if isinstance(field.default, Parameter)
        }

    @classmethod
    def read(cls, values: Mapping[str, Any], source: str) -> Self:
        """Make it from plain values. Raises SceneError with every problem."""
        with collected(cls, values, source):
            made = cls.model_validate(values)
        return made

    @field_validator("*", mode="before")
    @classmethod
    def _checked(cls, value: Any, info: ValidationInfo) -> Any:
        """Values that may vary become controls; fixed ones stay plain."""
        parameter = cls.parameters.get(info.field_name or "")
        if parameter is None:
            return value
        if isinstance(value, Parameter):
            value = parameter.default
        if value is None and parameter.default is None:
            return None
        try:
            control = parameter.control(value)
        except ValueError as error:
            message = f"{cls.called(info.data)}{error}"
            raise faults([Problem(path_of(error), message)], value) from None
        return control.value if isinstance(control, Setting) else control

    @classmethod
    def called(cls, values: Mapping[str, Any]) -> str:
        """Begin of a line about it: `film: `, `system "water": `."""
        name = values.get("name")
        return f'{cls.noun} "{name}": ' if isinstance(name, str) else f"{cls.noun}: "

    @classmethod
    def clashes(cls, values: Mapping[str, Any]) -> list[Problem]:
        """Names that stand for two things, in values that need not be valid otherwise."""
        return []

    @property
    def values(self) -> dict[str, Control]:
        """Its controls by name; a fixed value is a `Setting`."""
        found = {name: getattr(self, name) for name in self.parameters}
        return {
            name: value if isinstance(value, Control) else Setting(value)
            for name, value in found.items()
            if value is not None
        }

    @classmethod
    def help(cls) -> dict[str, str]:
        """One line of help for each value, from the text under its declaration."""
        return attribute_docs(cls)

    def document(self) -> dict[str, Any]:
        """The table as plain data, without values equal to their defaults."""
        entry: dict[str, Any] = {}
        for name, control in self.values.items():
            default = self.parameters[name].default
            if default is None or control != self.parameters[name].control(default):
                plain = control.document()
                entry[name] = list(plain) if isinstance(plain, tuple) else plain
        return entry


@contextmanager
def collected(model: type[Section], values: Mapping[str, Any], source: str) -> Iterator[None]:
    """Turn what Pydantic finds within the block, and clashes of names, into one SceneError."""
    problems = model.clashes(values)
    try:
        yield
    except ValidationError as error:
        known = {problem.path for problem in problems}
        found = [_problem(details, model, values) for details in error.errors()]
        problems += [problem for problem in found if problem.path not in known]
    if problems:
        raise SceneError(problems, source)


def _problem(details: Any, model: type[Section], values: Mapping[str, Any]) -> Problem:
    """One error of Pydantic in the words of motes."""
    path = details["loc"]
    if details["type"] == "fault" or not path:
        return Problem(path, details["msg"])
    key = path[-1]
    owner, table = _owner(model, values, path[:-1] if isinstance(key, str) else path[:-2])
    if details["type"] == "extra_forbidden":
        whose = owner.called(table).removesuffix(": ") or "a scene"
        menu = ", ".join(_menu(owner))
        return Problem(
            path, f'{whose} has no "{key}".{likely(str(key), _keys(owner))} It takes {menu}.'
        )
    called = owner.called(table)
    if details["type"] == "missing":
        return Problem(path, f'{called}a {key} is missing, such as {key} = "water".')
    if isinstance(key, int):
        return Problem(path, f"{called}each {path[-2]} must be a table [[{path[-2]}]].")
    if details["type"] == "tuple_type":
        return Problem(path, f"{called}{key} must be a list of tables [[{key}]].")
    if details["type"] in ("model_type", "model_attributes_type"):
        return Problem(path, f"{called}{key} must be a table [{key}].")
    return Problem(path, f"{called}{key}: {details['msg']}.")


def _keys(model: type[Section]) -> dict[str, Parameter | None]:
    """The keys of a table, with the parameters that they stand for."""
    return {
        field.alias or name: model.parameters.get(name)
        for name, field in model.model_fields.items()
    }


def _menu(model: type[Section]) -> list[str]:
    return [parameter.short() if parameter else key for key, parameter in _keys(model).items()]


def _owner(
    model: type[Section], values: Any, path: tuple[str | int, ...]
) -> tuple[type[Section], Mapping[str, Any]]:
    """The part that an error is in, and its plain values."""
    for key in path:
        values = values[key]
        for name, field in model.model_fields.items():
            if key == (field.alias or name):
                inner = [field.annotation, *get_args(field.annotation)]
                model = next(i for i in inner if isinstance(i, type) and issubclass(i, Section))
    return model, values if isinstance(values, Mapping) else {}
