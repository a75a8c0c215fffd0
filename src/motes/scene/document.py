"""The document: a scene and its systems, frozen and checked."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from motes import integrate
from motes.catalog import Component, find
from motes.catalog.parameter import quantity
from motes.control.control import Control
from motes.control.curve import Curve
from motes.errors import Problem, SceneError
from motes.scene import names
from motes.scene.entry import Entry
from motes.scene.section import Section, fault
from motes.scene.sections import Camera, Film, Periodic, Sky

Emitters = tuple[Annotated[Component, Entry("emit")], ...]
Forces = tuple[Annotated[Component, Entry("force")], ...]
Flows = tuple[Annotated[Component, Entry("flow")], ...]
Interactions = tuple[Annotated[Component, Entry("interact")], ...]
Solids = tuple[Annotated[Component, Entry("solid")], ...]
Retirements = tuple[Annotated[Component, Entry("retire")], ...]
Look = Annotated[Component, Entry("look")]

_METHODS = tuple(sorted(m.name for m in pkgutil.iter_modules(integrate.__path__)))
"""Names of the methods of time stepping; a scene needs to load only its own."""


def _by_name(parts: tuple[Any, ...]) -> tuple[Any, ...]:
    """Sorted by name, so that the order in a file never matters."""
    return tuple(sorted(parts, key=lambda part: part.name))


def _runnable(name: str | None) -> str | None:
    """A method that scenes can use; only its own table is loaded."""
    if name is not None:
        try:
            integrate.method(name)
        except SceneError as error:
            raise fault(str(error.problems[0].message)) from None
    return name


class System(Section):
    """Particles of one kind: how they are born, what moves them, how they look and die."""

    noun: ClassVar[str] = "system"
    lists: ClassVar[tuple[str, ...]] = ("emit", "force", "flow", "retire")

    name: str
    """The word that addresses and results know it by."""

    life: Control | None = quantity(None, "s", above=0, scope="birth")
    """Time from birth to death; without it, particles live until something else ends them."""

    mass: Control = quantity(1.0, "kg", above=0, scope="birth")
    """Mass of a particle; drag and wind act less on heavier ones."""

    size: Control = quantity(0.02, "m", at_least=0, scope="particle")
    """Diameter of a particle."""

    color: Control = quantity("#ffffff", at_least=0, scope="particle")
    """Colour of a particle; its alpha fades it."""

    look: Look = Field(default_factory=lambda: find("look", "points")())
    """How the particles are drawn."""

    capacity: int | None = quantity(None, shape="integer", at_least=1, at_most=1e10)
    """The most particles alive at once; beyond it, none are born."""

    integrator: str | None = quantity(None, menu=_METHODS)
    """Method of time stepping, where it is not the scene's."""

    emit: Emitters = ()
    """Where its particles are born."""

    force: Forces = ()
    """Forces on this system alone."""

    flow: Flows = ()
    """Flows that carry this system alone."""

    retire: Retirements = ()
    """Ways to die besides old age."""

    _sorted = field_validator(*lists)(_by_name)
    _runs = field_validator("integrator")(_runnable)

    def __init__(self, name: str, **values: Any) -> None:
        super().__init__(name=name, **values)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="after")
    def _lives(self) -> Self:
        """What runs over life needs a life."""
        if self.life is None:
            parts = [part for name in self.lists for part in getattr(self, name)]
            for owner in (self, *parts):
                for key, control in owner.values.items():
                    if isinstance(control, Curve) and control.over == "life":
                        where = key if owner is self else f"{owner.name}.{key}"
                        raise fault(
                            f'system "{self.name}": {where} runs over life, but its particles live '
                            "for ever. Give it a life, such as life = 2.0 (seconds)."
                        )
        return self

    @classmethod
    def clashes(cls, values: Mapping[str, Any]) -> list[Problem]:
        """Components of the system with one name, and names that its own values have."""
        look = [values.get("look", {"type": "points"})]
        lists = (*cls.lists, "look")
        found = names.faults({**values, "look": look}, lists, cls.model_fields, cls.called(values))
        one = [
            p if p.path[0] != "look" else Problem(("look", *p.path[2:]), p.message) for p in found
        ]
        return [*names.word(values.get("name"), ("name",), "system: "), *one]

    def document(self) -> dict[str, Any]:
        """The system as an entry of a scene file, without values equal to their defaults."""
        entry: dict[str, Any] = {"name": self.name, **super().document()}
        if (look := self.look.document()) != {"type": "points"}:
            entry["look"] = look
        return entry | _lists(self, self.lists)


class Scene(Section):
    """A whole scene: everything that a simulation and a film of it follow from."""

    noun: ClassVar[str] = "scene"
    lists: ClassVar[tuple[str, ...]] = ("force", "flow", "interact", "solid")

    title: str = quantity("", shape="text")
    """A short name for people."""

    about: str = quantity("", shape="text")
    """What there is to see, in a sentence or two."""

    seed: int = quantity(0, shape="integer", at_least=0, at_most=2**64 - 1)
    """Another number gives another random outcome."""

    duration: float = quantity(6.0, "s", above=0, at_most=1e6)
    """Length of the film."""

    step: float = quantity(0.01, "s", at_least=1e-9, at_most=10)
    """Length of a time step; it has nothing to do with the frames of the film."""

    prewarm: float = quantity(0.0, "s", at_least=0, at_most=1e5)
    """Time that is simulated before the first frame."""

    integrator: str = quantity("rk4", menu=_METHODS)
    """Method of time stepping."""

    precision: Literal["single", "double"] = quantity("single", menu=("single", "double"))
    """Numbers of 32 bits, quick and right for effects, or of 64 bits, for science."""

    mode: Literal["fast", "strict"] = quantity("fast", menu=("fast", "strict"))
    """strict: the same bits on any processor of one architecture; fast: sums may be reordered."""

    film: Film = Field(default_factory=Film)
    """Frames, size, exposure."""

    camera: Camera = Field(default_factory=Camera)
    """Where the scene is seen from."""

    sky: Sky = Field(default_factory=Sky)
    """What is behind everything."""

    periodic: Periodic = Field(default_factory=Periodic)
    """A box that repeats, for matter without walls."""

    force: Forces = ()
    """Forces on every system."""

    flow: Flows = ()
    """Flows that carry every system."""

    interact: Interactions = ()
    """Laws between particles, of one system or of several."""

    solid: Solids = ()
    """Shapes that bounce particles, hide what is behind them, and are drawn."""

    systems: tuple[System, ...] = Field((), alias="system")
    """The particle systems."""

    _sorted = field_validator("systems", *lists)(_by_name)
    _runs = field_validator("integrator")(_runnable)

    def __init__(self, **values: Any) -> None:
        # A file says [[system]] for each; Python has them in one list.
        if "systems" in values:
            values["system"] = values.pop("systems")
        super().__init__(**values)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def called(cls, values: Mapping[str, Any]) -> str:
        """Nothing: a line about the scene itself begins with the fault."""
        return ""

    @classmethod
    def clashes(cls, values: Mapping[str, Any]) -> list[Problem]:
        """Systems and components of the whole scene with one name; and within each system.

        Also systems that an interaction names and that there are not.
        """
        reserved = [*cls.model_fields, *System.model_fields, "system"]
        found = names.faults(values, ("system", *cls.lists), reserved, "")
        found += names.strangers(values)
        systems = values.get("system")
        for i, system in enumerate(systems if isinstance(systems, list | tuple) else ()):
            within = System.clashes(system) if isinstance(system, Mapping) else []
            found += [Problem(("system", i, *p.path), p.message) for p in within]
        return found

    def document(self) -> dict[str, Any]:
        """The scene as plain data, the form of a scene file, without values equal to defaults."""
        entry = super().document()
        for name in ("film", "camera", "sky", "periodic"):
            if table := getattr(self, name).document():
                entry[name] = table
        entry |= _lists(self, self.lists)
        if self.systems:
            entry["system"] = [system.document() for system in self.systems]
        return entry

    def with_values(self, values: Mapping[str, Any]) -> Scene:
        """A copy with other values at addresses: {"water.emit.rate": 2000, "seed": 3}.

        An address may be shortened while it stands for one value only; `addresses` lists them in
        full. Raises SceneError for an unknown or ambiguous address, with the candidates, and for
        values that do not fit, with the address as it was given.
        """
        from motes.scene.address import addressed, placed

        document, given = placed(self, values)
        try:
            return Scene.read(document, source="")
        except SceneError as error:
            raise SceneError([addressed(p, given) for p in error.problems], source="") from None

    def addresses(self) -> list[str]:
        """The full addresses of all values: `seed`, `film.size`, `water.cone.rate`."""
        from motes.scene.address import places

        return [place.address for place in places(self)]

    def to_toml(self) -> str:
        """The text of a scene file that reads back equal."""
        from motes.scene.write import toml

        return toml(self.document())

    def to_json(self) -> str:
        """The text of a scene file in JSON that reads back equal."""
        from motes.scene.write import json_text

        return json_text(self.document())


def a_scene(scene: Scene) -> Scene:
    """The scene itself; TypeError with the likely fix for what is none, such as its name."""
    if hasattr(scene, "document"):
        return scene
    fix = f' Write motes.load("{scene}").' if isinstance(scene, str) else ""
    raise TypeError(f"a Scene is needed, not {type(scene).__name__}.{fix}")


def _lists(owner: Section, lists: tuple[str, ...]) -> dict[str, Any]:
    """The components of an owner as entries, without empty lists."""
    found = {key: [part.document() for part in getattr(owner, key)] for key in lists}
    return {key: entries for key, entries in found.items() if entries}


def from_document(document: Mapping[str, Any], source: str = "scene") -> Scene:
    """A scene from plain data, the form of a scene file. Raises SceneError with every problem."""
    return Scene.read(document, source)


MOVING = ("emit", "force", "flow", "interact", "retire")
"""Lists of components that drawing does not look at."""


def drawable(document: Mapping[str, Any]) -> dict[str, Any]:
    """The document of kept frames without unknown components that only moved particles.

    Such a component was declared in a script; its frames are drawn without it.
    """
    kept = {key: list(filter(_known(key), document[key])) for key in MOVING if key in document}
    systems = [drawable(system) for system in document.get("system", ())]
    return {**document, **kept, **({"system": systems} if systems else {})}


def _known(kind: str) -> Callable[[Mapping[str, Any]], bool]:
    """Whether the catalog has the type of an entry of a list."""

    def known(entry: Mapping[str, Any]) -> bool:
        try:
            find(kind, str(entry["type"]))
        except (SceneError, KeyError):
            return False
        return True

    return known
