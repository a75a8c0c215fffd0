"""Parameters of components: unit, range, scope and help, and from a plain value to a control."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from motes.control.control import Control

Number: TypeAlias = Any
"""A number, or anything that gives one: random, a curve over time, life or speed."""
Vector: TypeAlias = Any
"""Three numbers x, y, z, or a control that gives them."""
Color: TypeAlias = Any
"""A colour: "#rrggbb", "#rrggbbaa" (sRGB) or [r, g, b] or [r, g, b, a] (linear); or a control."""
Integer: TypeAlias = Any
"""A whole number."""
Flag: TypeAlias = Any
"""True or false."""

SCOPES = ("fixed", "scene", "birth", "particle")
"""How much a value may vary, each including the ones before: not at all, over time, by a draw at
birth, from particle to particle at every instant."""

SHAPES = {"number": 1, "vector": 3, "color": 4, "integer": 1, "flag": 1, "pair": 2}
"""Kinds of values and how many numbers each has. A pair is two whole numbers. The others, `text`,
`choice` and `table`, are no numbers."""

FIXED_SHAPES = ("integer", "flag", "choice", "table", "text", "pair")
"""Shapes that do not vary unless a parameter says so."""


@dataclass(frozen=True)
class Parameter:
    """One declared parameter of a component or of the document."""

    default: Any
    unit: str = ""
    at_least: float | None = None
    at_most: float | None = None
    above: float | None = None
    below: float | None = None
    scope: str = ""
    shape: str = "number"
    menu: tuple[str, ...] = ()
    table: str = ""
    name: str = ""

    @property
    def width(self) -> int:
        """How many numbers one value has."""
        return SHAPES.get(self.shape, 1)

    def named(self, name: str, scope: str) -> Parameter:
        """The parameter with its name, and with a scope where it states none itself."""
        fixed = self.shape in FIXED_SHAPES
        return replace(self, name=name, scope=self.scope or ("fixed" if fixed else scope))

    def control(self, value: Any) -> Control:
        """Turn a plain value of the document into a checked control.

        Raises ValueError with one line that names the parameter, the fault and what is allowed.
        """
        from motes.control.parse import parse

        return parse(value, self)

    def short(self) -> str:
        """Name and unit, as menus show them: `rate [kg/s]`."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def range(self) -> str:
        """The allowed range in words, or an empty text."""
        unit = f" {self.unit}" if self.unit else ""
        bounds = (
            ("at least", self.at_least),
            ("above", self.above),
            ("at most", self.at_most),
            ("below", self.below),
        )
        stated = [(word, bound) for word, bound in bounds if bound is not None]
        return " and ".join(f"{word} {_shown(bound)}{unit}" for word, bound in stated)

    def contains(self, low: float, high: float) -> bool:
        """Whether all values from low to high lie in the allowed range."""
        return not (
            (self.at_least is not None and low < self.at_least)
            or (self.above is not None and low <= self.above)
            or (self.at_most is not None and high > self.at_most)
            or (self.below is not None and high >= self.below)
        )


def _shown(bound: float) -> str:
    """A bound with six digits; a whole number that a float would round, with all of its own."""
    return str(bound) if isinstance(bound, int) and float(bound) != bound else f"{bound:g}"


def quantity(
    default: Any,
    unit: str = "",
    *,
    at_least: float | None = None,
    at_most: float | None = None,
    above: float | None = None,
    below: float | None = None,
    scope: str = "",
    shape: str = "",
    menu: tuple[str, ...] = (),
    table: str = "",
) -> Any:
    """Declare a parameter: default value, SI unit, range, and how much it may vary.

    The shape follows from the default: a number, three numbers (a vector), "#rrggbb" (a colour), a
    whole number, true or false, one word of a `menu`, or a `table` of entries.
    """
    if not shape:
        if menu:
            shape = "choice"
        elif table:
            shape = "table"
        elif isinstance(default, bool):
            shape = "flag"
        elif isinstance(default, int):
            shape = "integer"
        elif isinstance(default, str):
            shape = "color"
        elif isinstance(default, tuple | list):
            shape = "vector"
        else:
            shape = "number"
    return Parameter(
        default, unit, at_least, at_most, above, below, scope, shape, tuple(menu), table
    )
