"""The kernel language, over the whole catalog: single precision stays single, nothing is called.

Each kernel is translated as for a scene, put into a loop over arrays and compiled; the text of its
machine code (LLVM) is searched. What is outside the language is refused in one line with the menu.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import Component, catalog
from motes.compile.text import Text
from motes.jit import jit
from motes.kernel import kernel
from motes.kernel.language import Translation

RESULTS = {
    "acceleration": 3, "velocity": 3, "relaxation": 4, "limited": 3, "distance": 1, "dies": 1,
}  # fmt: skip
STATE = ("x", "y", "z", "vx", "vy", "vz")
WIDTHS = {"color": 4, "obstacle": 4}

CASES = [
    (component, name)
    for kind in ("force", "flow", "solid", "retire")
    for component in catalog(kind).values()
    for name in RESULTS
    if component.kernel(name) is not None
]
NAMES = [f"{component.kind.name}-{component.type}-{name}" for component, name in CASES]


def shifted(component: type[Component]) -> Component:
    """The component with its parameters off their defaults where it may be, so that none folds."""
    values: dict[str, Any] = {}
    for key in component.own:
        default = component().values[key]
        if default.scope == "birth":  # A draw, of which a kernel sees one number.
            values[key] = 0.4
        if default.scope == "scene":
            moved = [float(v) + 0.25 for v in default.bounds()[:1]] * default.width
            value = moved if len(moved) > 1 else moved[0]
            try:
                component(**{key: value})
            except motes.SceneError:  # Such as a whole number.
                continue
            values[key] = value
    return component(**values)


def machine_code(component: Component, name: str) -> str:
    """LLVM's text of the loop over a kernel in single precision, without what Python calls."""
    text = Text("single")
    columns = (*STATE, *component.needs)
    fields = {c: f"X[{k}][i]" for k, c in enumerate(columns)}
    for wide in fields.keys() & WIDTHS.keys():
        fields[wide] = f"({', '.join([fields[wide]] * WIDTHS[wide])})"
    place = "X[0][i], X[1][i], X[2][i]"
    arguments = place if name == "distance" else f"{text.record('Q', fields)}, t"
    arguments += f", {place}" if name == "limited" else ""
    call = text.call(component, "it", name, arguments).source
    total = " + ".join(f"r[{k}]" for k in range(RESULTS[name])) if RESULTS[name] > 1 else "r"
    text.add(text.values.scene_text())
    text.add(
        "def loop(X, out, K, t):\n    S = scene(K, t)\n"
        f"    for i in range(out.size):\n        r = {call}\n        out[i] = {total}\n"
    )
    loop = jit(text.module()["loop"])
    constants, *others = text.values.arrays(np.float32)
    X = tuple(np.linspace(0.1, 1.0, 64, dtype=np.float32) for _ in columns)
    K = (constants.astype(np.float32), *others)
    code = loop.llvm(X, np.empty(64, np.float32), K, np.float32(0.5))
    (function,) = re.findall(r"^define internal [^\n]*@loop.*?^}", code, re.M | re.S)
    return function


@pytest.mark.parametrize(("component", "name"), CASES, ids=NAMES)
def test_single_precision_stays_single_and_calls_nothing(
    component: type[Component], name: str
) -> None:
    """No double arithmetic and no external call in any kernel's machine code."""
    code = machine_code(shifted(component), name)
    doubles = re.findall(r"= (?:f\w+|sitofp|uitofp)\b.*\bdouble\b.*", code)
    # A square root is one instruction, whatever LLVM calls it.
    calls = re.findall(r"call [^@\n]*@(?!llvm\.|sqrtf\b)[^(\n]*", code)
    assert not doubles, doubles[:3]
    assert not calls, calls[:3]


@pytest.mark.parametrize(("component", "name"), CASES, ids=NAMES)
def test_a_kernel_runs_uncompiled(component: type[Component], name: str) -> None:
    """A kernel is a Python function, too: finite for a plain particle."""

    class Fields:
        def __init__(self, **values: Any) -> None:
            self.__dict__.update(values)

    values = {key: getattr(component(), key) for key in component.own}
    values = {key: 0.4 if isinstance(value, dict) else value for key, value in values.items()}
    function = component.kernel(name)
    assert function is not None
    column = {need: [0.5] * WIDTHS[need] if need in WIDTHS else 0.5 for need in component.needs}
    q = Fields(**dict.fromkeys(STATE, 0.5), **column)
    place = (0.5, 0.6, 0.7) if name == "distance" else (q, 0.25)
    place += (0.1, 0.2, 0.3) if name == "limited" else ()
    assert np.isfinite(function(Fields(**values), *place)).all()


@kernel
def with_math(p, q, t):  # type: ignore[no-untyped-def]
    return math.exp(t)


@kernel
def with_an_unknown_name(p, q, t):  # type: ignore[no-untyped-def]
    return t * nowhere  # noqa: F821


@pytest.mark.parametrize(
    ("function", "fault"), [(with_math, "exp"), (with_an_unknown_name, '"nowhere" is not known')]
)
def test_what_is_outside_the_language_is_refused_in_one_line(function: Any, fault: str) -> None:
    """The error names the kernel, the line and the fault."""
    with pytest.raises(motes.SceneError) as caught:
        Translation().add(function, 'force "mine"')
    message = str(caught.value)
    assert 'force "mine"' in message
    assert fault in message
    assert "line" in message
    assert "sqrt" in message  # The menu.
    assert "\n" not in message.strip()
