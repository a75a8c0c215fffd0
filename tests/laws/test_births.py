"""Laws of births: when, where, how many, and that nobody else's fate depends on them."""

from __future__ import annotations

import numpy as np
import pytest

import motes


def simulation(emit: list, **scene: object) -> motes.Simulation:
    system = {k: scene.pop(k) for k in ("life", "size", "color", "mass", "capacity") if k in scene}
    settings = {"precision": "double", "step": 0.01, "duration": 10.0, **scene}
    return motes.Simulation(
        motes.Scene(systems=[motes.System("s", emit=emit, **system)], **settings)
    )


def test_the_kth_birth_happens_when_the_integral_of_the_rate_reaches_k() -> None:
    """Rate 100 t: the integral 50 t^2 reaches k at sqrt(k / 50)."""
    rate = {"over": "time", "keys": [[0, 0], [10, 1000]]}
    sim = simulation([motes.emit.Point(rate=rate)])
    sim.run(until=1.0)
    times = np.sort(sim["s"].birth)
    assert len(times) == 50
    assert times == pytest.approx(np.sqrt(np.arange(1, 51) / 50), rel=1e-9)


@pytest.mark.parametrize("step", [0.001, 0.01, 0.3])
def test_no_birth_is_lost_or_doubled_at_any_step(step: float) -> None:
    """n = floor(integral of the rate), whatever the step (the lecture's n = (t - t_last) rate)."""
    sim = simulation([motes.emit.Point(rate=333.3)], step=step)
    sim.run(until=1.2)
    assert sim.count == np.floor(333.3 * sim.time)
    assert len(np.unique(sim["s"].id)) == sim.count


def test_a_newborn_is_integrated_for_the_rest_of_its_step() -> None:
    """x = x0 + v (t - t_k), with its own birth instant t_k."""
    sim = simulation([motes.emit.Point(rate=50.0, velocity=(2.0, 0.0, 0.0))], step=0.5)
    sim.run(steps=2)
    s = sim["s"]
    assert s.position[:, 0] == pytest.approx(2.0 * (sim.time - s.birth), rel=1e-12)


def test_births_spread_along_the_path_of_a_moving_emitter() -> None:
    """The emitter's pose is taken at each birth's own instant, not once a step."""
    path = {"over": "time", "keys": [[0, [0, 0, 0]], [1, [4, 0, 0]]]}
    sim = simulation([motes.emit.Point(rate=40.0, position=path)], step=1.0)
    sim.run(steps=1)
    assert np.sort(sim["s"].position[:, 0]) == pytest.approx(4 * np.arange(1, 41) / 40, rel=1e-9)


def test_a_curve_that_does_not_move_gives_what_a_constant_gives() -> None:
    """An emitter that stands still is placed once a step, another one at each birth."""
    cone = {"rate": 500.0, "direction": (1.0, 2.0, -0.5), "radius": 0.3, "angle": 40.0}
    still = simulation(
        [motes.emit.Cone(**cone, position=(1.0, 2.0, 3.0))], size={"mean": 2.0, "spread": 1.0}
    )
    path = {"over": "time", "keys": [[0, [1, 2, 3]], [10, [1, 2, 3]]]}
    moving = simulation([motes.emit.Cone(**cone, position=path)], size={"mean": 2.0, "spread": 1.0})
    for sim in (still, moving):
        sim.run(until=0.5)
    assert still.count == 250
    for column in ("id", "birth", "size"):
        assert np.array_equal(getattr(still["s"], column), getattr(moving["s"], column))
    assert still["s"].position == pytest.approx(moving["s"].position, rel=1e-14)
    assert still["s"].velocity == pytest.approx(moving["s"].velocity, rel=1e-14)


def test_newborns_inherit_the_emitters_velocity() -> None:
    """v = share of the derivative of the path."""
    path = {"over": "time", "keys": [[0, [0, 0, 0]], [10, [0, 30, 0]]]}
    sim = simulation([motes.emit.Point(rate=10.0, position=path, inherit=0.5)])
    sim.run(until=1.0)
    assert sim["s"].velocity[:, 1] == pytest.approx(1.5, rel=1e-6)


def test_bursts_delay_duration_and_capacity() -> None:
    burst = [{"at": 0.1, "count": 7, "every": 0.2, "times": 3}]
    sim = simulation([motes.emit.Point(burst=burst, delay=0.05)])
    for until, expected in ((0.14, 0), (0.16, 7), (0.36, 14), (2.0, 21)):
        sim.run(until=until)
        assert sim.count == expected
    sim = simulation([motes.emit.Point(rate=100.0, delay=0.5, duration=0.3)])
    sim.run(until=2.0)
    assert sim.count == 30
    sim = simulation([motes.emit.Point(rate=100.0)], capacity=25)
    sim.run(until=2.0)
    assert sim.count == 25


def test_prewarm_is_a_run_before_time_zero() -> None:
    sim = simulation([motes.emit.Point(rate=100.0)], prewarm=0.5)
    assert sim.time == 0
    assert sim.count == 50


def test_life_ends_at_its_length() -> None:
    sim = simulation([motes.emit.Point(rate=100.0)], life={"mean": 0.5, "spread": 0.1})
    sim.run(until=3.0)
    s = sim["s"]
    assert (s.age < s.life).all()
    assert s.life.min() >= 0.4
    assert s.life.max() <= 0.6
    assert sim.count == pytest.approx(50, abs=6)


def test_directions_fill_a_cone_evenly() -> None:
    """cos(theta) is uniform in [cos(angle), 1]: its mean is the middle."""
    sim = simulation([motes.emit.Cone(burst=[{"count": 20000}], speed=2.0, angle=60.0)])
    sim.run(steps=1)
    v = sim["s"].velocity
    assert np.linalg.norm(v, axis=1) == pytest.approx(2.0, rel=1e-12)
    cosine = v[:, 2] / 2.0
    assert cosine.min() >= 0.5 - 1e-12
    sigma = 0.5 / np.sqrt(12 * len(v))
    assert cosine.mean() == pytest.approx(0.75, abs=4 * sigma)
    assert v[:, 0].mean() == pytest.approx(0.0, abs=4 * 1.2 / np.sqrt(len(v)))


SHAPES = {
    "Disc": ({"radius": 2.0}, lambda p: np.hypot(p[:, 0], p[:, 1]) ** 2 / 4, (0, 1)),
    "Ring": ({"radius": 2.0, "inner": 1.0}, lambda p: np.hypot(p[:, 0], p[:, 1]) ** 2, (1, 4)),
    "Sphere": ({"radius": 2.0}, lambda p: np.linalg.norm(p, axis=1) ** 3 / 8, (0, 1)),
    "Shell": ({"radius": 2.0, "thickness": 1.0}, lambda p: np.linalg.norm(p, axis=1) ** 3, (1, 8)),
    "Box": ({"size": (2.0, 4.0, 6.0)}, lambda p: p[:, 2], (-3, 3)),
    "Line": ({"length": 3.0}, lambda p: p[:, 0], (-1.5, 1.5)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_are_filled_evenly(shape: str) -> None:
    """The measure of the shape (length, area, volume) up to a point is uniform."""
    values, measure, (low, high) = SHAPES[shape]
    sim = simulation([getattr(motes.emit, shape)(burst=[{"count": 20000}], **values)])
    sim.run(steps=1)
    u = (measure(sim["s"].position) - low) / (high - low)
    assert u.min() >= -1e-9
    assert u.max() <= 1 + 1e-9
    histogram = np.histogram(u, 20, (0, 1))[0]
    assert ((histogram - 1000) ** 2 / 1000).sum() < 50  # chi squared, 19 degrees: 1 in 10^4


def test_the_axis_of_an_emitter_turns_with_its_direction() -> None:
    for direction in ((1, 0, 0), (0, 1, 0), (0, 0, -1), (0, -1, 0), (1, 2, -2)):
        emitter = motes.emit.Disc(
            burst=[{"count": 500}], radius=1.0, speed=3.0, direction=direction
        )
        sim = simulation([emitter])
        sim.run(steps=1)
        n = np.array(direction) / np.linalg.norm(direction)
        assert sim["s"].velocity == pytest.approx(np.tile(3.0 * n, (500, 1)), abs=1e-12)
        moved = sim["s"].position - sim["s"].velocity * sim["s"].age[:, None]
        assert moved @ n == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(moved, axis=1).max() <= 1 + 1e-12


def draws(scene: motes.Scene) -> dict[int, tuple]:
    sim = motes.Simulation(scene)
    sim.run(until=0.5)
    s = sim["s"]
    return {
        int(i): (b, *v, m) for i, b, v, m in zip(s.id, s.birth, s.velocity, s.mass, strict=True)
    }


def test_removing_an_emitter_changes_no_other_particle() -> None:
    """Ids and draws hang on addresses: what else is in the scene does not matter."""
    a = motes.emit.Cone(name="a", rate=200.0, speed={"mean": 3.0, "spread": 1.0})
    b = motes.emit.Cone(name="b", rate=300.0, speed={"normal": [2.0, 0.3]})
    mass = {"mean": 1.0, "spread": 0.5}
    common = {"precision": "double", "step": 0.01, "seed": 5}
    both = draws(motes.Scene(systems=[motes.System("s", emit=[a, b], mass=mass)], **common))
    alone = draws(motes.Scene(systems=[motes.System("s", emit=[a], mass=mass)], **common))
    assert len(alone) == 100
    assert all(both[key] == value for key, value in alone.items())


def test_removing_a_force_changes_no_draw() -> None:
    a = motes.emit.Cone(rate=200.0, speed={"mean": 3.0, "spread": 1.0})
    mass = {"mean": 1.0, "spread": 0.5}
    forces = [
        motes.force.Drag(rate={"mean": 0.0, "spread": 0.0}),
        motes.force.Gravity(g=(0.0, 0.0, 0.0)),
    ]
    common = {"precision": "double", "step": 0.01, "seed": 5}
    with_forces = draws(
        motes.Scene(systems=[motes.System("s", emit=[a], mass=mass, force=forces)], **common)
    )
    without = draws(motes.Scene(systems=[motes.System("s", emit=[a], mass=mass)], **common))
    assert with_forces == without


def test_another_seed_gives_other_draws() -> None:
    a = motes.emit.Cone(rate=200.0, speed={"mean": 3.0, "spread": 1.0})
    scene = motes.Scene(systems=[motes.System("s", emit=[a])], step=0.01)
    one, two = (motes.Simulation(scene.with_values({"seed": s})) for s in (1, 2))
    one.run(steps=20)
    two.run(steps=20)
    assert one.digest() != two.digest()


def test_digest_does_not_depend_on_how_a_run_is_cut_or_looked_at() -> None:
    scene = motes.Scene(
        systems=[motes.System("s", emit=[motes.emit.Cone(rate=3000.0)], life=0.3)],
        force=[motes.force.Gravity()],
        solid=[motes.solid.Plane(position=(0, 0, -0.1))],
        step=0.01,
    )
    whole, cut = motes.Simulation(scene), motes.Simulation(scene)
    whole.run(steps=100)
    for _ in range(100):
        cut.step()
        cut.frame(cut.time + 0.0042)
    assert whole.digest() == cut.digest()


def test_frames_go_on_where_a_simulation_is() -> None:
    sim = simulation([motes.emit.Point(rate=100.0)], duration=1.0)
    sim.run(until=0.5)
    frames = list(sim.frames())
    assert [frames[0].index, frames[-1].index] == [13, 24]
    assert frames[0].time == 0.5


@pytest.mark.parametrize(
    "many", [{"rate": 1e8}, {"burst": [{"at": 0.005, "count": 10**6}]}], ids=["rate", "burst"]
)
def test_births_that_do_not_fit_into_memory_name_their_emitter(
    many: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The budget is asked before anything is allocated."""
    sim = simulation([motes.emit.Point(**many)], capacity=10)
    monkeypatch.setattr("motes.memory._budget", 10**7)
    with pytest.raises(motes.MemoryBudgetError, match=r'^emitter "s\.point": 1e\+06 births in'):
        sim.run(steps=1)
