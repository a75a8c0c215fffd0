"""From a value in a document to a control, or one line that says what is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import date, time
from itertools import islice
from typing import Any

import numpy as np

from motes.catalog.parameter import SCOPES, Parameter
from motes.control.color import parse_color
from motes.control.constant import Constant, Setting
from motes.control.control import Control, Values
from motes.control.curve import SCOPE_OF, Curve
from motes.control.draw import Choice, Normal, Uniform
from motes.control.spline import Spline
from motes.errors import ValueFault, likely, within

INTERPOLATIONS = ("linear", "smooth", "monotone", "constant", "bezier")
LARGEST = 1e30
"""Numbers beyond it would overflow in single precision as soon as they are multiplied."""

EXTRAPOLATIONS = ("hold", "loop", "pingpong", "extend")
FORMS = {
    "scene": '{ over = "time", keys = [[t, value], ...] }',
    "birth": "{ mean = m, spread = s }, { normal = [mean, sigma] }, { choice = [a, b] }",
    "particle": '{ over = "life", keys = [[0, value], [1, value]] }',
}


def parse(value: Any, parameter: Parameter) -> Control:
    """Make the control that a document's value stands for.

    Raises ValueError with one line: the parameter's name, the fault, what is allowed.
    """
    if parameter.scope == "fixed":
        plain = value.document() if isinstance(value, Control) else value
        return Setting(_setting(plain, parameter))
    with np.errstate(all="ignore"):  # Extreme keys overflow; the check of the range finds them.
        control = _control(value, parameter)
        low, high = control.bounds()
    if SCOPES.index(control.scope) > SCOPES.index(parameter.scope):
        raise ValueError(
            f"{parameter.name} cannot vary {_how(control)}. It takes {_allowed(parameter)}."
        )
    if math.isnan(low) or math.isnan(high):
        raise ValueError(f"{parameter.name}: {_shown(value)} has keys too close to each other.")
    if not parameter.contains(low, high):
        out = low if not parameter.contains(low, low) else high
        unit = f" {parameter.unit}" if parameter.unit else ""
        shown = f"{out:.6g}" if isinstance(control, Constant) else f"reaches {out:.6g}"
        equals = "= " if isinstance(control, Constant) else ""
        raise ValueError(f"{parameter.name} {equals}{shown}{unit} must be {parameter.range()}.")
    return control


def _control(value: Any, parameter: Parameter) -> Control:
    if isinstance(value, Control):
        if value.width != parameter.width:
            raise ValueError(f"{parameter.name} must be a {parameter.shape}, not {_shown(value)}.")
        return value
    if isinstance(value, Mapping):
        return _varying(value, parameter)
    return Constant(_plain(value, parameter), _tidy(value))


def _tidy(value: Any) -> Any:
    """Tuples as lists, NumPy numbers as Python ones: the form that TOML and JSON can hold."""
    if isinstance(value, Mapping):
        return {str(k): _tidy(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if _is_list(value):
        return [_tidy(v) for v in value]
    return value


def _how(control: Control) -> str:
    if isinstance(control, Curve):
        return f"over {control.over}"
    return "from particle to particle"


def _allowed(parameter: Parameter) -> str:
    """The forms that a parameter takes, in words."""
    forms = [f"a {parameter.shape}"]
    reach = SCOPES.index(parameter.scope)
    forms += [FORMS[scope] for scope in SCOPES[1 : reach + 1]]
    return " or ".join(forms)


def _number(value: Any, name: str) -> float:
    """A finite number of a size that single precision holds."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ValueError(f"{name} must be a number, not {_shown(value)}.")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} = {number} must be finite.")
    if abs(number) > LARGEST:
        raise ValueError(f"{name} = {number:g} must be within -{LARGEST:g} to {LARGEST:g}.")
    return number


def _whole(value: Any, parameter: Parameter) -> int:
    """A whole number within the parameter's range, exact beyond what a float holds."""
    name = parameter.name
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if isinstance(value, float):
        whole = _number(value, name).is_integer()
    if not whole:
        raise ValueError(f"{name} must be a whole number, not {_shown(value)}.")
    number = int(value)
    if not parameter.contains(number, number):
        unit = f" {parameter.unit}" if parameter.unit else ""
        raise ValueError(f"{name} = {_shown(number)}{unit} must be {parameter.range()}.")
    return number


def _shown(value: Any) -> str:
    """A short form of a wrong value, as a scene file writes it."""
    if isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, date | time):
        text = value.isoformat()
    elif isinstance(value, Mapping):
        text = "{ " + ", ".join(f"{k} = {_shown(v)}" for k, v in islice(value.items(), 9)) + " }"
    else:
        text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _plain(value: Any, parameter: Parameter) -> Values:
    """A constant of the parameter's shape."""
    name = parameter.name
    if parameter.shape == "color":
        return parse_color(value, name)
    if parameter.shape == "vector":
        sequence = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
        if not sequence or len(value) != 3:
            unit = f" {parameter.unit}" if parameter.unit else ""
            raise ValueError(f"{name} must be [x, y, z]{unit}, not {_shown(value)}.")
        return np.array([_number(v, name) for v in value])
    if parameter.shape == "integer":
        return np.array([float(_whole(value, parameter))])
    return np.array([_number(value, name)])


def _setting(value: Any, parameter: Parameter) -> Any:
    """A value that cannot vary: a choice, a flag, a text, a table, numbers."""
    name = parameter.name
    if parameter.shape == "text":
        if not isinstance(value, str):
            raise ValueError(f"{name} must be a text in quotes, not {_shown(value)}.")
        return value
    if parameter.shape == "choice":
        if not isinstance(value, str) or value not in parameter.menu:
            raise ValueError(
                f"{name} must be one of {', '.join(parameter.menu)}, not {_shown(value)}."
                + likely(str(value), parameter.menu)
            )
        return value
    if parameter.shape == "flag":
        if not isinstance(value, bool):
            raise ValueError(f"{name} must be true or false, not {_shown(value)}.")
        return value
    if parameter.shape == "table":
        from motes.control.tables import TABLES

        return TABLES[parameter.table](_tidy(value), name)
    if parameter.shape == "pair":
        if not _is_list(value) or len(value) != 2:
            raise ValueError(f"{name} must be two whole numbers, not {_shown(value)}.")
        return tuple(_whole(v, parameter) for v in value)
    if parameter.shape == "integer":
        return _whole(value, parameter)
    numbers = _plain(value, parameter)
    if not parameter.contains(numbers.min(), numbers.max()):
        unit = f" {parameter.unit}" if parameter.unit else ""
        raise ValueError(f"{name} = {_shown(value)}{unit} must be {parameter.range()}.")
    return numbers.tolist() if parameter.width > 1 else float(numbers[0])


def _varying(value: Mapping[str, Any], parameter: Parameter) -> Control:
    """A control from a table of the document, told apart by the keys that it has."""
    name, document = parameter.name, _tidy(value)
    for marks, make in _FORMS:
        if all(mark in value for mark in marks):
            return make(value, parameter, document)
    takes = f"It takes {_allowed(parameter)}."
    if stranger := next((str(key) for key in value if key not in _WORDS), None):
        hint = likely(stranger, _WORDS)
        raise ValueFault(f'{name} has no key "{stranger}".{hint} {takes}', (stranger,))
    raise ValueError(f"{name}: {_shown(value)} is no control. {takes}")


def _only(value: Mapping[str, Any], keys: Sequence[str], name: str) -> None:
    for key in value:
        if key not in keys:
            hint = f"{likely(str(key), keys)} It takes {', '.join(keys)}."
            raise ValueFault(f'{name} has no key "{key}".{hint}', (key,))


def _mean_spread(value: Mapping[str, Any], parameter: Parameter, document: Any) -> Control:
    _only(value, ("mean", "spread"), parameter.name)
    with within("mean"):
        mean = _plain(value["mean"], parameter)
    with within("spread"):
        spread = _spread(value.get("spread", 0.0), parameter)
    return Uniform(mean - spread, mean + spread, document)


def _spread(value: Any, parameter: Parameter) -> Values:
    """Half the width of an interval: one number for all components, or one for each.

    One number for a colour leaves its alpha as it is.
    """
    name, count = f"{parameter.name}.spread", parameter.width
    if _is_list(value):
        spread = [_number(v, name) for v in value]
        if parameter.shape == "color" and len(spread) == 3:
            spread.append(0.0)
    else:
        spread = [_number(value, name)] * count
        if parameter.shape == "color":
            spread[3] = 0.0
    if len(spread) != count:
        raise ValueError(f"{name} must have {count} numbers.")
    if min(spread) < 0:
        raise ValueError(f"{name} must be at least 0.")
    return np.array(spread)


def _low_high(value: Mapping[str, Any], parameter: Parameter, document: Any) -> Control:
    _only(value, ("low", "high"), parameter.name)
    with within("low"):
        low = _plain(value["low"], parameter)
    with within("high"):
        high = _plain(value["high"], parameter)
    if (low > high).any():
        raise ValueError(f"{parameter.name}: low is above high.")
    return Uniform(low, high, document)


def _normal(value: Mapping[str, Any], parameter: Parameter, document: Any) -> Control:
    _only(value, ("normal",), parameter.name)
    pair = value["normal"]
    with within("normal"):
        if not _is_list(pair) or len(pair) != 2:
            raise ValueError(f"{parameter.name}: normal must be [mean, sigma], not {_shown(pair)}.")
        mean = _plain(pair[0], parameter)
        sigma = np.full(mean.size, _number(pair[1], f"{parameter.name}: sigma"))
        if (sigma < 0).any():
            raise ValueError(f"{parameter.name}: sigma must be at least 0.")
    if parameter.shape == "color":
        sigma[3] = 0.0
    return Normal(mean, sigma, document)


def _choice(value: Mapping[str, Any], parameter: Parameter, document: Any) -> Control:
    _only(value, ("choice",), parameter.name)
    menu, values = value["choice"], []
    if not _is_list(menu) or not menu:
        raise ValueError(f"{parameter.name}: choice must be a list of values, not {_shown(menu)}.")
    for i, entry in enumerate(menu):
        with within("choice", i):
            values.append(_plain(entry, parameter))
    return Choice(np.array(values), document)


def _curve(value: Mapping[str, Any], parameter: Parameter, document: Any) -> Control:
    name = parameter.name
    words = {
        "over": tuple(SCOPE_OF),
        "interpolation": INTERPOLATIONS,
        "before": EXTRAPOLATIONS,
        "after": EXTRAPOLATIONS,
    }
    rows = "stops" if "stops" in value else "keys"
    _only(value, (*words, rows), name)
    options = {}
    for word, menu in words.items():
        if word in value and value[word] not in menu:
            hint = likely(str(value[word]), menu)
            shown = f"{', '.join(menu)}, not {_shown(value[word])}."
            raise ValueFault(f"{name}: {word} must be one of {shown}{hint}", (word,))
        if word in value:
            options[word] = value[word]
    over = options.pop("over")
    times, values, handles = _keys(value[rows], over, rows, parameter)
    if handles and (options.get("interpolation") != "bezier" or len(handles) != len(times)):
        raise ValueError(
            f'{name}: keys with handles need interpolation = "bezier", and every key its two.'
        )
    try:
        spline = Spline(
            np.array(times),
            np.array(values) if parameter.width > 1 else np.array(values)[:, 0],
            handles=np.array(handles) if handles else None,
            **options,
        )
    except ValueError as fault:
        raise ValueError(f"{name}: {fault}.") from None
    return Curve(over, spline, parameter.width, document)


def _keys(
    rows: Any, over: str, word: str, parameter: Parameter
) -> tuple[list[float], list[Values], list[list[list[float]]]]:
    """Times, values and handles of a curve's keys."""
    name = parameter.name
    times, values, handles = [], [], []
    if not _is_list(rows) or not rows:
        raise ValueFault(f"{name}: {word} must be a list [[{over}, value], ...].", (word,))
    for i, row in enumerate(rows):
        with within(word, i):
            if not _is_list(row) or len(row) not in (2, 4):
                raise ValueError(f"{name}: a key must be [{over}, value], not {_shown(row)}.")
            time = _number(row[0], f"{name}: {over}")
            if over in ("life", "random") and not 0 <= time <= 1:
                raise ValueError(f"{name}: keys over {over} run from 0 to 1, not to {time:g}.")
            times.append(time)
            values.append(_plain(row[1], parameter))
            if len(row) == 4:
                handles.append([_handle(h, name) for h in row[2:]])
    return times, values, handles


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _handle(value: Any, name: str) -> list[float]:
    if not _is_list(value) or len(value) != 2:
        raise ValueError(f"{name}: a handle must be [dt, dvalue], not {_shown(value)}.")
    return [_number(v, f"{name}: handle") for v in value]


_FORMS = (
    (("over", "keys"), _curve),
    (("over", "stops"), _curve),
    (("mean",), _mean_spread),
    (("low", "high"), _low_high),
    (("normal",), _normal),
    (("choice",), _choice),
)

_WORDS = ("spread", "interpolation", "before", "after", *(m for marks, _ in _FORMS for m in marks))
"""Every key that some control has."""
