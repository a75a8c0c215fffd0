"""Write docs/ode_methods.md from the tables: python3 docs/ode_methods.py [--check]."""

from __future__ import annotations

import inspect
import math
import sys
from importlib import import_module
from pathlib import Path

from motes import ode
from motes.integrate import method
from motes.ode.stability import error_constant

PAGE = Path(__file__).with_suffix(".md")
COLUMNS = (
    "method", "order", "stages", "kind", "estimate of order", "decay", "oscillation",
    "error constant",
)  # fmt: skip
NOTICE = "<!-- Written by docs/ode_methods.py. -->\n"


def number(value: float) -> str:
    """Three digits, a sign for no limit, a dash for what does not apply."""
    if math.isnan(value):
        return "–"
    return "∞" if math.isinf(value) else f"{value:.3g}"


def facts_of(m: ode.MethodFacts) -> str:
    """What a method's table says about it, in sentences."""
    found = method(m.name)
    stages = f"{m.stages} stage{'s' if m.stages > 1 else ''}"
    parts = [f"Order {m.order}, {stages}"]
    if not math.isnan(constant := error_constant(found)):
        parts.append(f"error constant {constant:.3g}")
    if m.embedded is not None:
        parts.append(f"error estimate of order {m.embedded}")
    parts += ["symplectic"] * m.symplectic
    if getattr(found, "a_explicit", ()):
        parts.append("takes a `stiff` part alone")
    limits = []
    if not math.isnan(m.real):
        limits.append("any decay" if math.isinf(m.real) else f"decays to h k = {m.real:.3g}")
    limits.append(
        "any oscillation" if math.isinf(m.imaginary)
        else f"oscillations to h w = {m.imaginary:.3g}" if m.imaginary else "no oscillation"
    )  # fmt: skip
    return f"{', '.join(parts)}. Stable for {' and '.join(limits)}."


def page() -> str:
    """The whole page."""
    lines = [
        NOTICE,
        "# Methods of `motes.ode`\n",
        "Decay: the largest h k at which x' = -k x does not grow. Oscillation: the largest h w at "
        "which x'' = -w² x does not. Error constant: the root of the summed squares by which the "
        "conditions of the next order are missed.\n",
        f"| {' | '.join(COLUMNS)} |",
        f"|{' --- |' * len(COLUMNS)}",
    ]
    facts = ode.methods()
    for m in facts:
        kind = "implicit" if m.implicit else "explicit"
        kind += ", symplectic" if m.symplectic else ""
        low = "–" if m.embedded is None else str(m.embedded)
        constant = number(error_constant(method(m.name)))
        lines.append(
            f"| [{m.name}](#{m.name}) | {m.order} | {m.stages} | {kind} | {low} | "
            f"{number(m.real)} | {number(m.imaginary)} | {constant} |"
        )
    for m in facts:
        text = inspect.cleandoc(import_module(f"motes.integrate.{m.name}").__doc__ or "")
        lines.append(f"\n## {m.name}\n\n{text}\n\n{facts_of(m)}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the page, or with --check only say whether it is stale."""
    text = page()
    if "--check" in sys.argv:
        if not PAGE.exists() or PAGE.read_text(encoding="utf-8") != text:
            sys.exit(f"{PAGE.name} is stale: run python3 docs/{Path(__file__).name}")
        return
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
