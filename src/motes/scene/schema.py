"""JSON Schema of scenes, made from the parts of the document and the catalog."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

from motes.catalog import KINDS, Component, catalog, kinds
from motes.catalog.parameter import SCOPES, Parameter
from motes.control.curve import SCOPE_OF
from motes.control.parse import EXTRAPOLATIONS, INTERPOLATIONS
from motes.control.tables import MOST, SPECIES
from motes.scene.document import Scene, System
from motes.scene.names import WORD
from motes.scene.section import Section
from motes.scene.sections import Camera, Film, Periodic, Sky

Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_PLAIN: dict[str, Schema] = {
    "number": _NUMBER,
    "integer": {"type": "integer"},
    "vector": {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3},
    "color": {
        "anyOf": [
            {"type": "string", "pattern": "^#([0-9a-fA-F]{6}|[0-9a-fA-F]{8})$"},
            {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 4},
        ]
    },
}
"""Constants by shape."""

_NAME: Schema = {"type": "string", "pattern": rf"^{WORD.pattern}$"}


_SECTIONS: dict[str, type[Section]] = {
    "film": Film,
    "camera": Camera,
    "sky": Sky,
    "periodic": Periodic,
}


def schema() -> Schema:
    """JSON Schema (draft 2020-12) of a scene file, for editors that complete and check.

    It knows all components that are in the catalog now. What it accepts may still be refused: that
    names are not taken twice and that curves stay in range is more than a schema can say.
    """
    definitions: Schema = {}
    for shape in _PLAIN:
        definitions |= _forms(shape)
    for kind in KINDS:
        definitions |= _kind(kind)
    for name, model in _SECTIONS.items():
        definitions[name] = _section(model)
    definitions["system"] = _section(
        System,
        {"name": _NAME, "look": {"$ref": "#/$defs/look"}, **_lists(System.lists)},
        required=("name",),
    )
    tables = {name: {"$ref": f"#/$defs/{name}"} for name in _SECTIONS}
    whole = _section(Scene, tables | _lists((*Scene.lists, "system")))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **whole,
        "title": "A scene of motes",
        "$defs": definitions,
    }


def _section(
    model: type[Section], inner: Mapping[str, Schema] | None = None, required: tuple[str, ...] = ()
) -> Schema:
    """A table of the document: its parameters, and `inner` for what is no parameter."""
    parameters = {name: _parameter(p) for name, p in model.parameters.items()}
    return _object(model, model.help(), {**parameters, **(inner or {})}, required)


def _lists(names: tuple[str, ...]) -> Schema:
    return {name: {"type": "array", "items": {"$ref": f"#/$defs/{name}"}} for name in names}


def _kind(kind: str) -> Schema:
    """Definitions of the components of a kind, and of the choice between them."""
    found = catalog(kind)
    choice = [{"$ref": f"#/$defs/{kind}.{type}"} for type in found]
    made: Schema = {kind: {"title": kinds(kind).noun, "oneOf": choice}}
    for type, component in found.items():
        made[f"{kind}.{type}"] = _component(component)
    return made


def _component(component: type[Component]) -> Schema:
    parameters = {name: _parameter(p) for name, p in component.parameters.items()}
    properties = {"type": {"const": component.type}, "name": _NAME, **parameters}
    return _object(component, component.help(), properties, ("type",))


def _object(
    thing: type,
    help: Mapping[str, str],
    properties: Mapping[str, Schema],
    required: tuple[str, ...],
) -> Schema:
    described = {
        name: {**value, "description": help[name]} if name in help else value
        for name, value in properties.items()
    }
    made: Schema = {
        "title": thing.__name__,
        "description": inspect.cleandoc(thing.__doc__ or ""),
        "type": "object",
        "properties": described,
        "additionalProperties": False,
    }
    return made | ({"required": list(required)} if required else {})


def _parameter(parameter: Parameter) -> Schema:
    """What a value may be: a constant within the range, or a control that the scope allows."""
    made = _constant(parameter)
    reach = SCOPES.index(parameter.scope)
    if reach and parameter.shape in _PLAIN:
        forms = [{"$ref": f"#/$defs/{parameter.shape}.{s}"} for s in SCOPES[1 : reach + 1]]
        made = {"anyOf": [made, *forms]}
    if parameter.default is not None:
        default = parameter.default
        made["default"] = list(default) if isinstance(default, tuple) else default
    return made | ({"unit": parameter.unit} if parameter.unit else {})


def _constant(parameter: Parameter) -> Schema:
    shape = parameter.shape
    if shape == "choice":
        return {"enum": list(parameter.menu)}
    if shape == "flag":
        return {"type": "boolean"}
    if shape == "text":
        return {"type": "string"}
    if shape == "table":
        return _TABLES[parameter.table]
    bounds = {
        "minimum": parameter.at_least,
        "exclusiveMinimum": parameter.above,
        "maximum": parameter.at_most,
        "exclusiveMaximum": parameter.below,
    }
    limits = {word: bound for word, bound in bounds.items() if bound is not None}
    if shape == "pair":
        items = {"type": "integer", **limits}
        return {"type": "array", "items": items, "minItems": 2, "maxItems": 2}
    if shape == "vector":
        return {**_PLAIN[shape], "items": {**_NUMBER, **limits}}
    return {**_PLAIN[shape], **limits} if shape != "color" else dict(_PLAIN[shape])


def _forms(shape: str) -> Schema:
    """Definitions of the controls of a shape, by the scope that they need."""
    plain = _PLAIN[shape]
    spread = {"anyOf": [_NUMBER, {"type": "array", "items": _NUMBER}]}
    draws = [
        _table({"mean": plain, "spread": spread}, ("mean",)),
        _table({"low": plain, "high": plain}, ("low", "high")),
        _table({"normal": {"type": "array", "prefixItems": [plain, _NUMBER]}}, ("normal",)),
        _table({"choice": {"type": "array", "items": plain, "minItems": 1}}, ("choice",)),
    ]
    made: Schema = {}
    for scope in SCOPES[1:]:
        over = [word for word, needed in SCOPE_OF.items() if needed == scope]
        curves = [_curve(plain, over, keys) for keys in ("keys", "stops")]
        made[f"{shape}.{scope}"] = {"anyOf": [*curves, *(draws if scope == "birth" else [])]}
    return made


def _curve(plain: Schema, over: list[str], keys: str) -> Schema:
    key = {"type": "array", "prefixItems": [_NUMBER, plain], "minItems": 2, "maxItems": 4}
    properties = {
        "over": {"enum": over},
        keys: {"type": "array", "items": key, "minItems": 1},
        "interpolation": {"enum": list(INTERPOLATIONS)},
        "before": {"enum": list(EXTRAPOLATIONS)},
        "after": {"enum": list(EXTRAPOLATIONS)},
    }
    return _table(properties, ("over", keys))


def _table(properties: Schema, required: tuple[str, ...]) -> Schema:
    return {
        "type": "object",
        "properties": properties,
        "required": list(required),
        "additionalProperties": False,
    }


_TABLES: dict[str, Schema] = {
    "bursts": {
        "type": "array",
        "items": _table(
            {key: {"type": "number", "minimum": 0, "maximum": most} for key, most in MOST.items()},
            ("count",),
        ),
    },
    "species": {
        "type": "object",
        "additionalProperties": _table({key: {"type": "number"} for key in SPECIES}, ()),
    },
    "names": {
        "type": "array",
        "items": {"type": "string", "minLength": 1},
        "uniqueItems": True,
    },
}
"""Values that are lists of small tables or of names, as `motes.control.tables` reads them."""
