"""Settings that are small tables of their own, such as an emitter's bursts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from motes.errors import likely, within

MOST = {"at": 1e9, "count": 1e9, "every": 1e9, "times": 1e5}
"""Keys of a burst and the largest number that each takes."""


def bursts(value: Any, name: str) -> list[dict[str, float]]:
    """Bursts `{ at = s, count = n, every = s, times = n }`; the last two repeat it.

    Raises ValueError with one line.
    """
    if not isinstance(value, list):
        raise ValueError(f"{name} must be a list [{{ at = 0.5, count = 100 }}, ...].")
    result = []
    for number, entry in enumerate(value):
        with within(number):
            result.append(_burst(entry, name))
    return result


def _burst(entry: Any, name: str) -> dict[str, float]:
    """One burst with all of its keys."""
    if not isinstance(entry, dict) or "count" not in entry:
        raise ValueError(f"{name}: a burst must be {{ at = seconds, count = particles }}.")
    for key, number in entry.items():
        with within(key):
            if key not in MOST:
                raise ValueError(
                    f'{name}: a burst has no key "{key}".{likely(str(key), MOST)} '
                    f"It takes {', '.join(MOST)}."
                )
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise ValueError(f"{name}.{key} must be a number, not {str(number)[:40]}.")
            if not 0 <= number <= MOST[key]:
                raise ValueError(f"{name}.{key} = {number} must be from 0 to {MOST[key]:g}.")
            if key in ("count", "times") and number != int(number):
                raise ValueError(f"{name}.{key} = {number} must be a whole number.")
    burst = {"at": 0.0, "every": 0.0, "times": 1, **entry}
    if burst["times"] > 1 and not burst["every"] > 0:
        raise ValueError(f"{name}: a burst that repeats needs every above 0 s.")
    return burst


def names(value: Any, name: str) -> list[str]:
    """A list of names of systems.

    Raises ValueError with one line.
    """
    if not isinstance(value, list) or not all(isinstance(n, str) and n for n in value):
        raise ValueError(f'{name} must be a list of names, such as ["stars", "dust"].')
    if len(set(value)) < len(value):
        raise ValueError(f"{name} must name each system once.")
    return value


def species(value: Any, name: str) -> dict[str, dict[str, float]]:
    """Values of systems by name: { argon = { epsilon = 1.0 }, ... }; also an empty list.

    Raises ValueError with one line.
    """
    if isinstance(value, list) and not value:
        return {}
    if not isinstance(value, dict):
        raise ValueError(f"{name} must be {{ argon = {{ epsilon = 1.0, sigma = 1.0 }}, ... }}.")
    for system, own in value.items():
        with within(system):
            if not isinstance(own, dict):
                raise ValueError(f"{name}.{system} must be a table, such as {{ epsilon = 1.0 }}.")
            for key, number in own.items():
                plain = isinstance(number, int | float) and not isinstance(number, bool)
                if key not in SPECIES:
                    raise ValueError(
                        f'{name}.{system} has no "{key}".{likely(str(key), SPECIES)} '
                        f"It takes {', '.join(SPECIES)}."
                    )
                if not plain or (key != "charge" and number < 0) or abs(number) > 1e30:
                    raise ValueError(
                        f"{name}.{system}.{key} = {number} must be a number, not below 0."
                    )
    return {system: {k: float(v) for k, v in own.items()} for system, own in value.items()}


SPECIES = ("epsilon", "sigma", "charge")
"""What a system may have of its own in a pair law."""

TABLES: dict[str, Callable[[Any, str], Any]] = {
    "bursts": bursts,
    "names": names,
    "species": species,
}
