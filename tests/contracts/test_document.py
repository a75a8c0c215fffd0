"""The document: built in Python or read from a file, it is the same; addresses; writing; schema."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from rich_scene import RICH

import motes
from motes import ode
from motes.errors import SceneError
from motes.scene import (
    Scene,
    System,
    drawable,
    from_document,
    gallery,
    gallery_text,
    load,
    loads,
    schema,
)
from motes.scene.address import component_address, places
from motes.scene.sections import Camera, Film, Sky

SECTIONS = (Scene, System, Film, Camera, Sky)
TEXTS = {"rich": RICH, **{name: gallery_text(name) for name in gallery()}}


@pytest.fixture(params=TEXTS, name="scene")
def _scene(request: pytest.FixtureRequest) -> Scene:
    return loads(TEXTS[request.param])


def lines_of(*arguments: Any, **options: Any) -> list[str]:
    with pytest.raises(SceneError) as caught:
        arguments[0](*arguments[1:], **options)
    return caught.value.lines()


def sparks(**values: Any) -> Scene:
    cone = motes.emit.Cone(rate=500)
    return Scene(systems=[System("sparks", emit=[cone], force=[motes.force.Gravity()], **values)])


def test_python_objects_and_plain_data_make_the_same_scene() -> None:
    text = """
        [[system]]
        name = "sparks"
        [[system.emit]]
        type = "cone"
        rate = 500
        [[system.force]]
        type = "gravity"
    """
    plain = {"type": "cone", "rate": 500.0}
    system = {"name": "sparks", "emit": [plain], "force": [{"type": "gravity"}]}
    assert sparks() == loads(text) == Scene(systems=[system])


def test_the_shortest_scene_is_complete() -> None:
    scene = loads('[[system]]\nname = "a"\n[[system.emit]]\ntype = "cone"\nrate = 500')
    assert (scene.duration, scene.step, scene.prewarm) == (6.0, 0.01, 0.0)
    assert (scene.integrator, scene.precision, scene.mode) == ("rk4", "single", "fast")
    assert scene.film.size == (1280, 720)
    (system,) = scene.systems
    assert system.life is None
    assert system.look.type == "points"
    assert system.size.bounds() == (0.02, 0.02)
    assert scene.camera.position.at(1.0).tolist() == [3.0, -6.0, 2.0]
    assert scene.camera.values["field_of_view"].at(0.0).tolist() == [40.0]


def test_writing_and_reading_give_the_same_scene(scene: Scene) -> None:
    assert loads(scene.to_toml()) == scene
    assert loads(scene.to_json(), format="json") == scene
    assert from_document(scene.document()) == scene
    assert loads(scene.to_toml()).to_toml() == scene.to_toml()


def test_texts_of_every_kind_survive_writing() -> None:
    title = 'quotes " and \\ and \n, tab \t, é, \x7f, \x1b, 星'
    scene = Scene(title=title)
    assert loads(scene.to_toml()).title == title
    assert loads(scene.to_json(), format="json").title == title


def reversed_lists(value: Any) -> Any:
    """The document with its tables in another order, and its lists of tables as well."""
    if isinstance(value, dict):
        return {key: reversed_lists(v) for key, v in reversed(value.items())}
    if isinstance(value, list) and all(isinstance(v, dict) and "count" not in v for v in value):
        return [reversed_lists(v) for v in reversed(value)]
    return value


def test_order_in_the_file_never_matters(scene: Scene) -> None:
    assert from_document(reversed_lists(scene.document())) == scene


def test_a_scene_is_frozen() -> None:
    scene = sparks()
    with pytest.raises(ValueError, match="frozen"):
        scene.seed = 3


def test_seeds_are_exact_beyond_floats() -> None:
    scene = Scene(seed=2**64 - 1)
    assert scene.seed == 2**64 - 1
    assert loads(scene.to_toml()) == scene
    assert lines_of(Scene, seed=2**64) == [
        "seed = 18446744073709551616 must be at least 0 and at most 18446744073709551615."
    ]


def test_values_replace_those_at_addresses() -> None:
    scene = sparks().with_values(
        {
            "sparks.emit.rate": 2000,
            "seed": 3,
            "film.size": [640, 360],
            "camera.position": [1, 2, 3],
            "sparks.look.emission": 2.0,
            "g": [0, 0, -1.62],
            "sparks.life": {"mean": 2, "spread": 0.5},
        }
    )
    (system,) = scene.systems
    assert system.emit[0].rate == 2000
    assert (scene.seed, scene.film.size, system.look.emission) == (3, (640, 360), 2.0)
    assert scene.camera.position.at(0).tolist() == [1, 2, 3]
    assert system.life is not None
    assert system.life.bounds() == (1.5, 2.5)
    assert sparks().with_values({}) == sparks()


def test_every_address_finds_its_own_value(scene: Scene) -> None:
    addresses = scene.addresses()
    assert len(set(addresses)) == len(addresses)
    now = {place.address: place for place in places(scene)}
    document = scene.with_values({}).document()
    own = {}
    for address in addresses:
        table: Any = document
        for key in now[address].path:
            table = table[key] if isinstance(key, int) else table.get(key)
            if table is None:
                break
        if table is not None:
            own[address] = table
    assert len(own) > 5
    assert scene.with_values(own) == scene


def test_an_address_may_be_shortened_while_it_is_unique() -> None:
    scene = sparks()
    for address in ("rate", "emit.rate", "cone.rate", "sparks.rate", "sparks.emit.cone.rate"):
        assert scene.with_values({address: 7}).systems[0].emit[0].rate == 7
    # A full address is never ambiguous, even where it is the end of others.
    noisy = scene.with_values({}).document() | {"force": [{"type": "wind"}]}
    assert from_document(noisy).with_values({"seed": 5}).seed == 5


@pytest.mark.parametrize(
    ("address", "line"),
    [
        ("sparks.emit.rat", 'no value has the address "sparks.emit.rat". Did you mean '
         '"sparks.emit.rate"? sparks.emit has rate, burst, delay, duration, position, '
         "direction, velocity, inherit, speed, angle, radius."),
        ("spark.rate", 'no value has the address "spark.rate". Did you mean "sparks.emit.rate"? '
         "There are: title, about, seed, duration, step, prewarm, integrator, precision, mode, "
         "film, camera, sky, periodic, sparks."),
        ("position", '"position" stands for several values: camera.position, sparks.cone.position. '
         "Write one of them."),
        ("sparks", 'no value has the address "sparks". Did you mean "sparks.life"? sparks has '
         "life, mass, size, color, capacity, integrator, look, emit, force."),
        ("", 'no value has the address "". There are: title, about, seed, duration, step, prewarm, '
         "integrator, precision, mode, film, camera, sky, periodic, sparks."),
    ],
)  # fmt: skip
def test_an_unclear_address_is_one_line_with_candidates(address: str, line: str) -> None:
    assert lines_of(sparks().with_values, {address: 1}) == [line]


def test_a_value_that_does_not_fit_an_address_is_one_line() -> None:
    assert lines_of(sparks().with_values, {"rate": -1, "seed": "x"}) == [
        'seed must be a whole number, not "x".',
        "rate: rate = -1 1/s must be at least 0 1/s.",
    ]


def test_frames_of_a_scripts_component_are_drawn_without_it() -> None:
    """What moved particles is not needed once they have moved; what is drawn is."""
    document = sparks().document()
    known = document["system"][0]["emit"]
    foreign = [*known, {"type": "of_a_script", "strength": 3}]
    changed = {**document, "system": [{**document["system"][0], "emit": foreign}]}
    assert drawable(changed)["system"][0]["emit"] == known
    assert from_document(drawable(changed)) == sparks()
    solid = {**document, "solid": [{"type": "of_a_script"}]}
    assert drawable(solid)["solid"] == solid["solid"]


def test_addresses_of_components() -> None:
    scene = loads(RICH)
    assert component_address(None, scene.force[0]) == scene.force[0].name
    system = scene.systems[0]
    assert component_address(system, system.emit[0]) == f"{system.name}.{system.emit[0].name}"


@pytest.mark.parametrize("section", SECTIONS)
def test_every_value_of_the_document_is_declared_in_full(section: Any) -> None:
    help = section.help()
    for name, parameter in section.parameters.items():
        assert help[name].endswith("."), name
        assert parameter.scope in ("fixed", "scene", "birth", "particle")
        if parameter.default is not None:
            parameter.control(parameter.default)


def test_the_schema_is_a_schema_and_accepts_every_scene(scene: Scene) -> None:
    whole = schema()
    jsonschema.Draft202012Validator.check_schema(whole)
    jsonschema.Draft202012Validator(whole).validate(json.loads(scene.to_json()))


@pytest.mark.parametrize("name", TEXTS)
def test_the_schema_accepts_files_as_written(name: str) -> None:
    jsonschema.Draft202012Validator(schema()).validate(tomllib.loads(TEXTS[name]))


@pytest.mark.parametrize(
    "document",
    [
        {"sed": 7},
        {"seed": -1},
        {"integrator": "rk5"},
        {"film": {"size": [640]}},
        {"force": [{"type": "drg"}]},
        {"force": [{"type": "drag", "rate": -1}]},
        {"system": [{}]},
        {"system": [{"name": "a", "look": {"type": "points", "emission": {"mean": 1}}}]},
    ],
)
def test_the_schema_refuses_what_reading_refuses(document: dict[str, Any]) -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema()).validate(document)
    with pytest.raises(SceneError):
        from_document(document)


def test_the_gallery_has_titles_and_loads_by_name() -> None:
    for name, title in gallery().items():
        scene = load(name)
        assert scene.title == title
        assert scene.about


def test_files_are_found_by_path(tmp_path: Path) -> None:
    scene = sparks()
    for name, text in (("a.toml", scene.to_toml()), ("b.JSON", scene.to_json())):
        (tmp_path / name).write_text(text, "utf-8")
        assert load(tmp_path / name) == load(str(tmp_path / name)) == scene
    windows = b"\xef\xbb\xbf" + scene.to_toml().replace("\n", "\r\n").encode()
    assert loads(windows) == scene


def test_import_of_motes_stays_light() -> None:
    program = "import sys, motes; print([m for m in ('pydantic', 'numba') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "[]\n"


def test_what_runs_over_life_needs_a_life() -> None:
    curve = {"over": "life", "keys": [[0, 1], [1, 0]]}
    with pytest.raises(SceneError, match='system "a": size runs over life'):
        Scene(systems=[System("a", size=curve)])
    drag = {"type": "drag", "rate": curve}
    with pytest.raises(SceneError, match=r'system "a": drag\.rate runs over life'):
        Scene(systems=[System("a", force=[drag])])
    Scene(systems=[System("a", size=curve, force=[drag], life=2.0)])


def test_a_scene_takes_every_method_of_the_toolbox() -> None:
    for method in ode.methods():
        assert Scene(integrator=method.name).integrator == method.name
    with pytest.raises(SceneError, match='Did you mean "radau5"'):
        Scene(integrator="radau")
