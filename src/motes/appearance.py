"""What particles look like at an instant: colour and size, from the controls of their system."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from motes.control.constant import Constant
from motes.control.control import Control
from motes.control.curve import Curve
from motes.jit import jit

if TYPE_CHECKING:
    from motes.scene.document import System
    from motes.view import View


class Look:
    """Evaluates a system's traits for drawing."""

    def __init__(self, system: System) -> None:
        traits = {name: getattr(system, name) for name in ("life", "mass", "size", "color")}
        self._controls: Mapping[str, Control] = {
            name: control for name, control in traits.items() if control is not None
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Traits that have a value."""
        return tuple(self._controls)

    def value(self, name: str, view: View) -> NDArray[Any]:
        """A trait of all particles: (n,), or (n, width) for a colour."""
        control = self._controls[name]
        values = _values(control, view)
        return values[:, 0] if control.width == 1 else values


def _values(control: Control, view: View) -> NDArray[Any]:
    """Values of a control that is not drawn at birth, (n, width)."""
    n = len(view)
    if isinstance(control, Constant) or (isinstance(control, Curve) and control.over == "time"):
        return np.broadcast_to(control.at(view.time), (n, control.width)).astype(np.float32)
    assert isinstance(control, Curve)
    if control.over == "order":
        from motes.matter import local_order

        place = local_order(view.position)
    elif control.over == "life":
        place = view.age / view.life
    else:
        place = np.sqrt((view.velocity.astype(float) ** 2).sum(axis=1))
    return interpolated(control, place)


def interpolated(control: Curve, place: NDArray[Any]) -> NDArray[np.float32]:
    """Values (n, width) of a curve over life or speed, from the table that kernels read too."""
    low, high = control.span
    place = np.ascontiguousarray(place, np.float64)
    values = np.empty((place.size, control.width), np.float32)
    _interpolate(place, low, 1 / max(high - low, 1e-30), control.table, values)
    return values


@jit
def _interpolate(place: Any, low: Any, per_span: Any, table: Any, values: Any) -> None:
    last = table.shape[0] - 1
    for i in range(place.size):
        u = min(max((place[i] - low) * per_span, 0.0), 1.0) * last
        left = min(int(u), last - 1)
        weight = u - left
        for k in range(table.shape[1]):
            values[i, k] = table[left, k] + weight * (table[left + 1, k] - table[left, k])
