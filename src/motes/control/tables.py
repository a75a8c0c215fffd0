"""Settings that are small tables of their own, such as an emitter's bursts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from motes.errors import likely

BURST_KEYS = ("at", "count", "every", "times")


def bursts(value: Any, name: str) -> list[dict[str, float]]:
    """Bursts `{ at = s, count = n, every = s, times = n }`; the last two repeat it.

    Raises ValueError with one line.
    """
    if not isinstance(value, list):
        raise ValueError(f"{name} must be a list [{{ at = 0.5, count = 100 }}, ...].")
    result = []
    for entry in value:
        if not isinstance(entry, dict) or "count" not in entry:
            raise ValueError(f"{name}: a burst must be {{ at = seconds, count = particles }}.")
        for key, number in entry.items():
            if key not in BURST_KEYS:
                raise ValueError(
                    f'{name}: a burst has no key "{key}".{likely(str(key), BURST_KEYS)} '
                    f"It takes {', '.join(BURST_KEYS)}."
                )
            if isinstance(number, bool) or not isinstance(number, int | float):
                raise ValueError(f"{name}.{key} must be a number, not {str(number)[:40]}.")
            if not math.isfinite(number) or number < 0 and key != "at":
                raise ValueError(f"{name}.{key} = {number} must be finite and at least 0.")
        burst = {"at": 0.0, "every": 0.0, "times": 1, **entry}
        for key in ("count", "times"):
            if burst[key] != int(burst[key]) or burst[key] > 1e9:
                raise ValueError(f"{name}.{key} = {burst[key]} must be a whole number up to 1e9.")
        if burst["times"] > 1 and not burst["every"] > 0:
            raise ValueError(f"{name}: a burst that repeats needs every above 0 s.")
        result.append(burst)
    return result


TABLES: dict[str, Callable[[Any, str], Any]] = {"bursts": bursts}
