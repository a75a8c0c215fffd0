"""Promises over the whole catalog: a new component is tested by existing."""

from __future__ import annotations

import linecache
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import motes
from motes.catalog import KINDS, Component, catalog, component, find, quantity
from motes.catalog.parameter import SCOPES
from motes.errors import SceneError
from motes.kernel import kernel

COMPONENTS = [
    pytest.param(c, id=f"{kind}/{name}")
    for kind in KINDS
    for name, c in catalog(kind).items()
    if c.__module__.startswith("motes.")
]


def values(part: type[Component]) -> SimpleNamespace:
    """The defaults of a component's parameters as plain numbers, as kernels see them."""
    made = part()
    plain = {}
    for key, control in made.values.items():
        if control.scope == "fixed":
            plain[key] = control.document()
        else:
            value = control.at(0.0)
            plain[key] = float(value[0]) if value.size == 1 else tuple(float(v) for v in value)
    return SimpleNamespace(**plain)


def particle(**changes: float) -> SimpleNamespace:
    state = {"x": 0.7, "y": -0.4, "z": 1.1, "vx": 0.3, "vy": 0.8, "vz": -0.5}
    traits = {"mass": 1.3, "age": 0.4, "life": 2.0, "size": 0.1, "color": (1.0, 0.5, 0.2, 0.8)}
    return SimpleNamespace(**{**state, **traits, **changes})


@pytest.mark.parametrize("part", COMPONENTS)
def test_every_parameter_has_unit_range_scope_and_help(part: type[Component]) -> None:
    help_ = part.help()
    assert part.__doc__
    assert part.__doc__.strip().endswith((".", ")", "]"))
    for name, parameter in part.parameters.items():
        assert parameter.name == name
        assert parameter.scope in SCOPES
        assert help_.get(name), f"{name} has no help"
        assert help_[name].endswith(".")
        parameter.control(parameter.default)


@pytest.mark.parametrize("part", COMPONENTS)
def test_a_component_survives_its_own_document(part: type[Component]) -> None:
    made = part()
    entry = made.document()
    assert entry.pop("type") == part.type
    assert part(**entry) == made


HAVING = [p for p in COMPONENTS if p.values[0].kernel("potential") is not None]
POTENTIALS = [p for p in HAVING if p.values[0].kernel("acceleration") is not None]
PAIR_LAWS = [p for p in COMPONENTS if p.values[0].kernel("force") is not None]


@pytest.mark.parametrize("part", POTENTIALS)
def test_force_is_minus_the_gradient_of_its_potential(part: type[Component]) -> None:
    """a = -grad phi, by central differences: error O(h^2)."""
    p, h = values(part), 1e-5
    potential, acceleration = part.kernel("potential"), part.kernel("acceleration")
    assert potential is not None
    assert acceleration is not None
    for place in ({}, {"x": 0.2, "y": 0.5, "z": -0.3}, {"x": -2.0, "z": 0.01}):
        q = particle(**place)
        gradient = []
        for axis in "xyz":
            ends = []
            for sign in (1, -1):
                moved = particle(**{**place, axis: getattr(q, axis) + sign * h})
                ends.append(potential(p, moved, 0.3))
            gradient.append((ends[0] - ends[1]) / (2 * h))
        assert acceleration(p, q, 0.3) == pytest.approx(-np.array(gradient), rel=1e-6, abs=1e-8)


def way(x: float, y: float, z: float) -> SimpleNamespace:
    square = x * x + y * y + z * z
    return SimpleNamespace(x=x, y=y, z=z, square=square, length=math.sqrt(square))


def pair_values(part: type[Component]) -> SimpleNamespace:
    """A pair law's parameters and constants at their defaults."""
    p = values(part)
    constants = part.kernel("constants")
    return SimpleNamespace(**vars(p), **(constants(p) if constants else {}))


@pytest.mark.parametrize("part", PAIR_LAWS)
def test_a_pair_force_is_minus_the_gradient_of_its_potential(part: type[Component]) -> None:
    """f = -dU/dr r/|r| by central differences, and f(b, a, -r) = -f(a, b, r), within the reach."""
    p, h = pair_values(part), 1e-6
    force, potential, reach = (part.kernel(k) for k in ("force", "potential", "reach"))
    assert force is not None
    assert reach is not None
    a, b = particle(vx=0.2), particle(mass=0.7)
    for share in (0.35, 0.6, 0.9, 0.99):
        place = share * reach(p) * np.array([2.0, -1.0, 2.0]) / 3.0
        f = np.array(force(p, a, b, way(*place)))
        assert np.array(force(p, b, a, way(*-place))) == pytest.approx(-f, rel=1e-12)
        if potential is None:
            continue
        gradient = [
            (potential(p, a, b, way(*(place + d))) - potential(p, a, b, way(*(place - d))))
            / (2 * h)
            for d in h * np.eye(3)
        ]
        assert f == pytest.approx(-np.array(gradient), rel=1e-6, abs=1e-8 * abs(f).max() + 1e-9)


SOLIDS = [p for p in COMPONENTS if p.values[0].kind.name == "solid"]


@pytest.mark.parametrize("part", SOLIDS)
def test_a_distance_grows_no_faster_than_one_metre_a_metre(part: type[Component]) -> None:
    """|d(a) - d(b)| <= |a - b|: impacts rely on it."""
    p, distance = values(part), part.kernel("distance")
    assert distance is not None
    points = np.random.default_rng(1).normal(scale=1.5, size=(400, 3))
    d = np.array([distance(p, *point) for point in points])
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert (np.abs(d[:, None] - d[None]) <= apart + 1e-12).all()
    assert (d < 0).any()
    assert (d > 0).any()


FLOWS = ["curl_noise"]


@pytest.mark.parametrize("name", FLOWS)
def test_turbulent_flow_has_no_divergence(name: str) -> None:
    """div u = 0, by central differences."""
    part = find("flow", name)
    p, velocity, h = values(part), part.kernel("velocity"), 1e-4
    assert velocity is not None
    for place in ({}, {"x": 3.1, "y": -2.2}, {"z": 7.7}):
        divergence = scale = 0.0
        for k, axis in enumerate("xyz"):
            at = getattr(particle(**place), axis)
            with np.errstate(over="ignore"):  # Hashes wrap around on purpose.
                ends = [
                    velocity(p, particle(**{**place, axis: at + s * h}), 0.3)[k] for s in (1, -1)
                ]
            divergence += (ends[0] - ends[1]) / (2 * h)
            scale += abs(ends[0] - ends[1]) / (2 * h)
        assert abs(divergence) < 1e-4 * scale


def test_a_component_of_a_script_joins_the_catalog() -> None:
    @component(kind="force", name="test_pull")
    class Pull:
        """A constant pull: a = (strength, 0, 0)."""

        strength = quantity(2.0, "m/s2")
        """Size of the pull."""

        @kernel
        def acceleration(p: Any, q: Any, t: Any) -> Any:
            return p.strength, 0.0, 0.0

    emitter = motes.emit.Point(burst=[{"count": 1}])
    scene = motes.Scene(systems=[motes.System("a", emit=[emitter])], force=[Pull(strength=3.0)])
    simulation = motes.Simulation(scene)
    simulation.run(until=1.0)
    assert simulation["a"].velocity[0, 0] == pytest.approx(3.0, rel=1e-5)
    assert catalog("force")["test_pull"] is Pull


CELL = """
from motes.catalog import Number, component, quantity
from motes.kernel import kernel

@component(kind="force", name="test_cell")
class Cell:
    \"\"\"A push: a = (push, 0, 0).\"\"\"

    push: Number = quantity(1.0, "m/s2")
    \"\"\"Its strength.\"\"\"

    @kernel
    def acceleration(p, q, t):
        return p.push, 0.0, 0.0
"""


def test_a_component_of_a_notebook_cell_joins_the_catalog() -> None:
    """A cell has no file; its text stands in linecache, where notebooks put it."""
    name = "<cell 1>"
    linecache.cache[name] = (len(CELL), None, CELL.splitlines(True), name)
    scope: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(CELL, name, "exec"), scope)
    assert scope["Cell"].help()["push"] == "Its strength."
    assert "push" in scope["Cell"].source()
    emitter = find("emit", "point")(burst=[{"count": 1}])
    system = motes.System("a", emit=[emitter], force=[scope["Cell"](push=2.0)])
    simulation = motes.Simulation(motes.Scene(systems=[system]))
    simulation.run(until=1.0)
    assert simulation["a"].velocity[0, 0] == pytest.approx(2.0, rel=1e-5)


def test_a_kernel_without_source_text_is_explained() -> None:
    scope: dict[str, Any] = {"__name__": "__main__"}
    exec(compile(CELL.replace("test_cell", "test_prompt"), "<stdin>", "exec"), scope)
    system = motes.System("a", emit=[find("emit", "point")()], force=[scope["Cell"]()])
    with pytest.raises(SceneError, match="file or a notebook cell"):
        motes.Simulation(motes.Scene(systems=[system]))


def test_faults_of_a_component_are_said_in_one_line() -> None:
    drag = find("force", "drag")
    with pytest.raises(
        SceneError, match=r'force "drag" has no parameter "rat"\. Did you mean "rate"'
    ):
        drag(rat=1.0)
    with pytest.raises(SceneError, match="rate = -1 kg/s must be at least 0 kg/s"):
        drag(rate=-1.0)
    with pytest.raises(SceneError, match="rate must be a number"):
        drag(rate="fast")
    with pytest.raises(SceneError, match="must be finite"):
        drag(rate=math.nan)
    with pytest.raises(SceneError, match='no force "drga"'):
        find("force", "drga")
    with pytest.raises(SceneError, match="kernel"):
        component(kind="force", name="nothing")(type("Nothing", (), {}))


def test_a_component_is_frozen() -> None:
    drag = find("force", "drag")()
    with pytest.raises(AttributeError, match="frozen"):
        drag.rate = 2.0
