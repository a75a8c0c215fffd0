"""The numbers that kernels read, laid out in a few arrays, and how generated text names them.

A constant is one entry of `constants`, so that changing it compiles nothing. A curve over time is a
packed spline, evaluated exactly at the time at which it is asked. A value drawn at birth is a
column of the system. A curve over life or speed is a function of its pieces' polynomials, unless it
has so many that a row of a lookup table is cheaper.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.control.constant import Constant, Setting
from motes.control.control import Control
from motes.control.curve import TABLE_SIZE, Curve
from motes.control.pieces import Pieces, pieces
from motes.errors import SceneError


@dataclass(frozen=True)
class Column:
    """Numbers of every particle that are drawn at its birth and kept."""

    address: str
    """Address of the parameter, which is also what its random numbers hang on."""
    control: Control
    shown: str = ""
    """Name under which the values are public: `life`, `mass`, `size`, `color`."""

    @property
    def width(self) -> int:
        """Numbers a particle."""
        return self.control.width


@dataclass
class Values:
    """Registers the values of a group of kernels; their expressions go into generated text.

    In the text, `S` is the tuple of values of the scene at one time, `C` the tuple of a particle's
    columns, `L` the lookup tables, `along_life` and `speed` what the tables run over.
    """

    constants: list[float] = field(default_factory=list)
    splines: list[NDArray[np.float64]] = field(default_factory=list)
    tables: list[NDArray[np.float64]] = field(default_factory=list)
    columns: list[Column] = field(default_factory=list)
    scene: list[str] = field(default_factory=list)
    over: set[str] = field(default_factory=set)
    curves: list[str] = field(default_factory=list)
    """Source of the functions of curves over life and speed."""

    def constant(self, value: float) -> str:
        """An entry of `constants` as an element of S."""
        self.constants.append(float(value))
        return self._scene(f"F(constants[{len(self.constants) - 1}])")

    def _scene(self, expression: str) -> str:
        self.scene.append(expression)
        return f"S[{len(self.scene) - 1}]"

    def _spline(self, packed: NDArray[np.float64]) -> str:
        self.splines.append(packed)
        k = len(self.splines) - 1
        return f"F(spline_at(splines[offsets[{k}] : offsets[{k + 1}]], t))"

    def add(
        self, control: Control, address: str, shown: str = "", at_birth: bool = False
    ) -> list[str]:
        """Register a control; returns the expressions of its components.

        `at_birth` is for values that a particle keeps for life: a curve over time then gives the
        value at its birth.
        """
        if isinstance(control, Setting):
            value = control.value
            return [repr(value) if isinstance(value, bool) else f"F({float(value)!r})"]
        if isinstance(control, Constant):
            return [self.constant(v) for v in control.values]
        if isinstance(control, Curve) and control.over == "time" and not at_birth:
            return [self._scene(self._spline(part)) for part in packed_parts(control)]
        if control.scope in ("birth", "scene"):
            return self._column(Column(address, control, shown))
        assert isinstance(control, Curve)
        return self._varying(control)

    def _column(self, column: Column) -> list[str]:
        start = 0
        for known in self.columns:
            if known.address == column.address:
                break
            start += known.width
        else:
            self.columns.append(column)
        return [f"C[{start + i}]" for i in range(column.width)]

    def _varying(self, control: Curve) -> list[str]:
        """A curve over life or speed, in pieces or from a table."""
        if control.over == "order":
            raise SceneError("a value over order can only be a colour: nothing may move by it.")
        self.over.add(control.over)
        low, high = control.span
        place = "along_life" if control.over == "life" else "speed"
        found = pieces(control.spline, low, high)
        if found is not None:
            return [f"{name}(S, {place})" for name in self._pieces(found)]
        if control.over == "speed":
            scale = self.constant(1.0 / max(high - low, 1e-30))
            place = f"(speed - {self.constant(low)}) * {scale}"
        first = len(self.tables)
        self.tables += list(control.table.T)
        return [f"lookup(L, {first + i}, {place})" for i in range(control.width)]

    def _pieces(self, found: Pieces) -> list[str]:
        """Write a function of S and the place for each component of a curve; returns their names.

        Places and lengths are shared by the components, so that machine code clamps once.
        """
        places = [self.constant(start) for start in found.starts]
        lengths = [self.constant(length) for length in found.lengths]
        names = []
        for component, first in enumerate(found.first):
            lines = f"    v = {self.constant(first)}\n"
            for k, (place, length) in enumerate(zip(places, lengths, strict=True)):
                if k and found.jumps_anywhere:
                    jump = self.constant(found.jumps[k, component])
                    lines += f"    v += {jump} if u >= {place} else F(0.0)\n"
                sums = ""
                for rise in reversed(found.rises[k, :, component]):
                    sums = f"w * ({self.constant(rise)}{' + ' if sums else ''}{sums})"
                if sums:
                    lines += f"    w = min(max(u - {place}, F(0.0)), {length})\n    v += {sums}\n"
            names.append(f"curve_{len(self.curves)}")
            self.curves.append(f"@inline\ndef {names[-1]}(S, u):\n{lines}    return v\n")
        return names

    def scene_text(self) -> str:
        """Source of `scene(K, t)`, the tuple S at a time, and of the curves that read it."""
        entries = "".join(f"{e}, " for e in self.scene) or "F(0.0),"
        return "\n\n".join(self.curves) + (
            "\n\n@inline\n"
            "def scene(K, t):\n"
            "    constants, offsets, splines, L = K\n"
            f"    return ({entries})\n"
        )

    @property
    def varies_in_time(self) -> bool:
        """Whether any value follows a curve over time."""
        return bool(self.splines)

    def arrays(self, real: Any) -> tuple[NDArray[Any], ...]:
        """K: constants, offsets of the splines, splines, and lookup tables of type `real`."""
        rows = [len(s) for s in self.splines]
        offsets = np.concatenate([[0], np.cumsum(rows)]).astype(np.int64)
        splines = np.concatenate(self.splines or [np.zeros((1, 1))])
        tables = np.array(self.tables) if self.tables else np.zeros((1, TABLE_SIZE))
        return (
            np.array(self.constants or [0.0]),
            offsets,
            np.ascontiguousarray(splines, np.float64),
            np.ascontiguousarray(tables, real),
        )


def packed_parts(control: Curve) -> list[NDArray[np.float64]]:
    """A packed spline for each component of a curve."""
    packed = control.spline.packed()
    return [packed] if packed.ndim == 2 else list(packed)
