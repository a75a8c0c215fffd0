"""Laws between near particles as loops: sums over neighbours, and what follows from them.

A gathering law's `near(p, a, b, r)` is summed over all neighbours b of a; its acceleration follows
from the sums. A pair law is the gathering law whose sums are the force on a. The neighbours of a
particle are gathered into consecutive memory, so that the loop over them is a few vector
instructions for eight neighbours, whatever the law says.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motes.catalog import Component
from motes.catalog.source import fields_read, function_node
from motes.compile.text import AXES, STATE, Text, packed
from motes.control.constant import Constant, Setting
from motes.errors import SceneError
from motes.jit import jit
from motes.kernel.language import can_fold
from motes.machine.shuffles import LANES, taken_apart

FORCE, POTENTIAL, VIRIAL = "force", "potential", "virial"
"""What a pair law's loops sum up besides what a gathering law's do, `near`."""


FROM_SQUARE = "square, sqrt(square), F(1.0) / sqrt(square + F(1e-30))"
"""What a law reads of a distance, from its square."""


class Law:
    """A law of limited reach: its kernels, and its numbers at a time."""

    def __init__(self, address: str, part: Component, precision: str, strict: bool) -> None:
        self.address, self.part = address, part
        self.precision, self.strict = precision, strict
        self.pairwise = type(part).kernel("force") is not None
        self.summed = FORCE if self.pairwise else "near"
        nearest = part.values["nearest"].document() if "nearest" in part.values else 0
        self.nearest = int(nearest)
        self.rebuild = int(part.values["rebuild"].document())
        self.owner = f'interaction "{part.name}"'
        values = part.values.values()
        self.lasting = all(isinstance(control, Setting | Constant) for control in values)
        """Whether its numbers are the same at all times."""
        self._time = float("nan")
        self._values_now: dict[tuple[str, str], dict[str, Any]] = {}
        self._numbers_now: dict[Any, NDArray[Any]] = {}
        self._reach: tuple[dict[str, Any], float] | None = None
        self._missing()

    def _missing(self) -> None:
        wanted = ("reach",) if self.pairwise else ("reach", "acceleration")
        for name in wanted:
            if type(self.part).kernel(name) is None:
                raise SceneError(f'{self.owner}: "{self.part.type}" must define {name}.')

    def _kernel(self, name: str) -> Callable[..., Any]:
        function = type(self.part).kernel(name)
        assert function is not None
        return function

    # ------------------------------------------------------------------ numbers

    def values(self, time: float, pair: tuple[str, str] = ("", "")) -> dict[str, Any]:
        """Parameters, and the constants that follow from them, at a time.

        `pair`: target and source, for laws that mix what two species have.
        """
        self._at(time)
        if type(self.part).kernel("mixed") is None:
            pair = ("", "")
        if pair not in self._values_now:
            self._values_now[pair] = self._values(time, pair)
        return self._values_now[pair]

    def _at(self, time: float) -> None:
        """Forget what was known of another time."""
        if self._time != time and not (self.lasting and self._values_now):
            self._time, self._values_now, self._numbers_now = time, {}, {}

    def _values(self, time: float, pair: tuple[str, str]) -> dict[str, Any]:

        found: dict[str, Any] = {}
        for key, control in self.part.values.items():
            if isinstance(control, Setting):
                found[key] = control.document()
            else:
                value = control.at(time)
                found[key] = float(value[0]) if value.size == 1 else tuple(map(float, value))
        constants, mixed = (type(self.part).kernel(k) for k in ("constants", "mixed"))
        own = mixed(SimpleNamespace(**found), *pair) if mixed else {}
        found |= {key: value for key, value in own.items() if key in found}
        if constants is not None:
            found |= constants(SimpleNamespace(**found))
        return found | own

    def reach(self, time: float) -> float:
        """Support radius at a time [m]."""
        values = self.values(time)
        if self._reach is None or self._reach[0] is not values:
            self._reach = values, float(self._kernel("reach")(SimpleNamespace(**values)))
        return self._reach[1]

    @cached_property
    def _fields(self) -> dict[str, int]:
        """Fields of `p` in kernels and how many numbers each has."""
        fields: dict[str, int] = {}
        common = set(self.part.parameters) - self.part.own
        for key, value in self.values(0.0).items():
            if (key not in common and not isinstance(value, str | list | dict | tuple | None)) or (
                isinstance(value, tuple) and value and not isinstance(value[0], str)
            ):
                fields[key] = len(value) if isinstance(value, tuple) else 1
        return fields

    def numbers(self, time: float, real: type, pair: tuple[str, str] = ("", "")) -> NDArray[Any]:
        """All numbers of `p`, as kernels read them."""
        self._at(time)
        if (real, pair) not in self._numbers_now:
            values = self.values(time, pair)
            numbers = [x for key in self._fields for x in np.atleast_1d(values[key])]
            self._numbers_now[real, pair] = np.array(numbers, real)
        return self._numbers_now[real, pair]

    # ------------------------------------------------------------------ fields of particles

    @cached_property
    def fields(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the numbers that the law reads of a target and of a source."""
        own, other = set(AXES), set(AXES)
        for name in (self.summed, POTENTIAL):
            if (function := type(self.part).kernel(name)) is not None:
                own |= self._read(function, 1)
                other |= self._read(function, 2)
        if self.pairwise:
            own.add("mass")
        else:
            own |= self._read(self._kernel("acceleration"), 1)
        return _in_order(own), _in_order(other)

    @property
    def depends_on_velocity(self) -> bool:
        """Whether the law reads velocities, so that a kick changes what it gives."""
        return any(name.startswith("v") and name in STATE for part in self.fields for name in part)

    def _read(self, function: Callable[..., Any], argument: int) -> set[str]:
        """What a kernel reads of its argument; all that there is where it passes it on."""
        return fields_read(function, argument, {*STATE, *self.part.needs})

    # ------------------------------------------------------------------ kernels

    def sums(self, what: str = "") -> int:
        """How many numbers a loop sums up."""
        if not what or what == self.summed:
            return 3 if self.pairwise else self._module[1]
        return 1 if what == POTENTIAL else 6

    def sweep(self, what: str = "") -> Any:
        """Kernel: sums over the neighbours of every particle of a part."""
        return self._module[0][f"sweep_{what or self.summed}"]

    @property
    def pushing(self) -> Any:
        """Kernel: the last sums of the particles of a part, and accelerations added to pushes."""
        return self._module[0]["pushing"]

    @cached_property
    def _module(self) -> tuple[dict[str, Any], int]:
        text = Text(self.precision, self.strict)
        writer = Writer(text, self)
        width = 3
        if self.pairwise:
            writer.sweep(FORCE, writer.call(FORCE), 3)
            if type(self.part).kernel(POTENTIAL) is not None:
                writer.sweep(POTENTIAL, f"({writer.call(POTENTIAL)},)", 1)
            writer.virial()
        else:
            width = _returned(self._kernel("near"), self.owner)
            writer.sweep("near", writer.call("near"), width)
        writer.finish(width)
        extra = {"int64": np.int64, "uint64": np.uint64, "uint32": np.uint32, "choose": choose}
        return text.module({**extra, "taken_apart": taken_apart}), width


class Writer:
    """Writes one law's loops."""

    def __init__(self, text: Text, law: Law) -> None:
        self.text, self.law = text, law
        self.own, self.other = law.fields
        self._names: dict[str, str] = {}

    def p(self) -> str:
        """An expression for `p`, from the array `numbers`."""
        expressions, place = {}, 0
        for key, width in self.law._fields.items():
            expressions[key] = packed([f"numbers[{place + k}]" for k in range(width)])
            place += width
        return self.text.record("P", expressions or {"nothing": "F(0.0)"})

    def particle(self, kind: str, names: tuple[str, ...], prefix: str) -> str:
        """An expression for a particle, from names of its numbers after a prefix."""
        return self.text.record(kind, {name: f"{prefix}{name}" for name in names})

    def call(self, name: str) -> str:
        """A call of a kernel of a pair."""
        a, b = self.particle("A", self.own, "a_"), self.particle("B", self.other, "b_")
        names = ("x", "y", "z", "square", "length", "inverse")
        way = ("rx", "ry", "rz", *FROM_SQUARE.split(", "))
        fields = dict(zip(names, way, strict=True))
        return f"{self.translated(name)}(p, {a}, {b}, {self.text.record('R', fields)})"

    def translated(self, name: str) -> str:
        """The name of one of the law's kernels in the text."""
        if name not in self._names:
            law = self.law
            function = law._kernel(name)
            settings = {
                key: (float(control.value),)
                for key, control in law.part.values.items()
                if key in law.part.own
                and isinstance(control, Setting)
                and isinstance(control.value, int | float)
            }
            if law.lasting:
                settings |= {k: (0.0,) for k in ("slope", "shift") if law.values(0.0).get(k) == 0.0}
            known = settings if settings and can_fold(function) else None
            self._names[name] = self.text.translation.add(function, law.owner, known)
        return self._names[name]

    def virial(self) -> None:
        """The force's six products x f_x, y f_y, z f_z, x f_y, x f_z, y f_z."""
        self.text.add(
            "@inline\ndef products(f, x, y, z):\n"
            "    return x * f[0], y * f[1], z * f[2], x * f[1], x * f[2], y * f[2]\n"
        )
        self.sweep(VIRIAL, f"products({self.call(FORCE)}, rx, ry, rz)", 6)

    def sweep(self, what: str, call: str, width: int) -> None:
        """The loop that sums a call's numbers up over lists of whole vectors."""
        own, sums = self.own, range(width)
        other = tuple(n for n in self.other if n not in AXES)
        lines = (
            f"@kernel\ndef sweep_{what}(numbers, targets, records, sources, limit, fresh, out, "
            "begin, first, entry, longest):\n"
            f"    room = empty(({len(other) + 3}, longest), F)\n"
            f"    p = {self.p()}\n    quarter = F(0.25) * limit\n"
        )
        lines += "".join(f"    t_{n} = targets[{i}]\n" for i, n in enumerate(own))
        lines += "".join(f"    s_{n} = sources[{i}]\n" for i, n in enumerate(other))
        if self.law.nearest:
            lines += f"    best, pick = empty({self.law.nearest}, F), "
            lines += f"empty({self.law.nearest}, int64)\n"
        lines += "    for k in range(uint64(first.size - 1)):\n"
        lines += "        i = uint64(begin) + k\n"
        lines += f"        low, high = {LANES} * first[k], {LANES} * first[k + 1]\n"
        lines += "        slot = entry[low:high]\n"
        for i, n in enumerate((*AXES, *other)):
            lines += f"        q_{n} = room[{i}][:slot.size]\n"
        lines += "        taken_apart(records, slot, q_x, q_y, q_z)\n"
        if other:
            lines += "        for q in range(slot.size):\n            k_ = uint32(slot[q])\n"
            lines += "".join(f"            q_{n}[q] = s_{n}[k_]\n" for n in other)
        lines += "".join(f"        a_{n} = t_{n}[i]\n" for n in own)
        lines += "".join(f"        sum{j} = F(0.0)\n" for j in sums)
        loaded = "            rx, ry, rz = a_x - b_x, a_y - b_y, a_z - b_z\n"
        loaded += "            square = rx * rx + ry * ry + rz * rz\n"
        term = "(" + ", ".join(f"n{j}" for j in sums) + f",) = {call}\n"
        if self.law.nearest:
            lines += "        found = choose(a_x, a_y, a_z, q_x, q_y, q_z, limit, best, pick)\n"
            lines += "        for e in range(found):\n            q = pick[e]\n"
        else:
            lines += "        for q in range(high - low):\n"
        lines += "".join(f"            b_{n} = q_{n}[q]\n" for n in (*AXES, *other)) + loaded
        if self.law.nearest:
            lines += f"            {term}"
            lines += "".join(f"            sum{j} += n{j}\n" for j in sums)
        else:
            # Who does not count is taken at half of the reach, where laws are finite, and times 0:
            # a choice of the summand itself would not become vector instructions.
            lines += "            near = square <= limit\n"
            lines += "            square = square if near else quarter\n"
            lines += "            w = F(1.0) if near else F(0.0)\n"
            lines += f"            {term}"
            lines += "".join(f"            sum{j} += n{j} * w\n" for j in sums)
        lines += "        if fresh:\n"
        lines += "".join(f"            out[{j}, i] = sum{j}\n" for j in sums)
        lines += "        else:\n"
        lines += "".join(f"            out[{j}, i] += sum{j}\n" for j in sums)
        self.text.add(lines)

    def finish(self, width: int) -> None:
        """The loop from sums to accelerations, and the one that sums up and does that."""
        names, law = self.own, self.law
        lines = "@kernel\ndef finish(numbers, targets, sums, order, push, lo, hi):\n"
        lines += f"    p = {self.p()}\n"
        lines += "".join(f"    t_{n} = targets[{i}]\n" for i, n in enumerate(names))
        lines += "    for i in range(lo, hi):\n"
        lines += "".join(f"        a_{n} = t_{n}[i]\n" for n in names)
        given = "(" + "".join(f"sums[{k}, i], " for k in range(width)) + ")"
        if law.pairwise:
            lines += "        w = F(1.0) / a_mass\n"
            lines += "        fx, fy, fz = sums[0, i] * w, sums[1, i] * w, sums[2, i] * w\n"
        else:
            a = self.particle("A", names, "a_")
            lines += f"        fx, fy, fz = {self.translated('acceleration')}(p, {a}, {given})\n"
        lines += "        row = order[i]\n"
        lines += "".join(f"        push[{k}, row] += f{axis}\n" for k, axis in enumerate(AXES))
        self.text.add(lines)
        self.text.add(
            "@kernel\ndef pushing(numbers, targets, records, sources, limit, fresh, out, order, "
            "push, own, begin, first, entry, longest):\n"
            f"    sweep_{law.summed}(numbers, targets, records, sources, limit, fresh, out, begin, "
            "first, entry, longest)\n"
            "    finish(own, targets, out, order, push, begin, begin + first.size - 1)\n"
        )


@jit(inline=True)
def choose(
    x: Any, y: Any, z: Any, xs: Any, ys: Any, zs: Any, limit: Any, best: Any, pick: Any
) -> Any:
    """Places of the nearest few within reach, nearest first, into `pick`; returns how many."""
    found = 0
    for q in range(xs.size):
        dx, dy, dz = x - xs[q], y - ys[q], z - zs[q]
        square = dx * dx + dy * dy + dz * dz
        if square > limit or (found == pick.size and square >= best[found - 1]):
            continue
        if found < pick.size:
            found += 1
        k = found - 1
        while k > 0 and best[k - 1] > square:
            best[k], pick[k] = best[k - 1], pick[k - 1]
            k -= 1
        best[k], pick[k] = square, q
    return found


def _in_order(names: set[str]) -> tuple[str, ...]:
    known = [name for name in STATE if name in names]
    return (*known, *sorted(names - set(STATE)))


def _returned(function: Callable[..., Any], owner: str) -> int:
    """How many numbers a kernel returns."""
    node = function_node(getattr(function, "py_func", function))
    counts = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Return):
            counts.add(len(part.value.elts) if isinstance(part.value, ast.Tuple) else 0)
    if len(counts) != 1 or 0 in counts:
        raise SceneError(f"{owner}: near must return a tuple of numbers, always as many.")
    return counts.pop()
