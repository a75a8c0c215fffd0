"""Curves over life and speed as kernels evaluate them: a sum of clamped polynomials."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import motes
from motes.control.pieces import BOUND, MOST, pieces
from motes.control.spline import Spline

TRIPLE = ([0.1, 0.4, 0.9], [1.0, -2.0, 0.5])
HANDLES = [[[0, 0], [0.2, 0.1]], [[-0.1, 0.3], [0.2, -0.6]], [[-0.1, 0], [0, 0]]]
CURVES: dict[str, tuple[Spline, float]] = {
    "linear": (Spline([0, 1], [1, 2]), 0.0),
    "several keys": (Spline(*TRIPLE), 0.0),
    "smooth": (Spline(*TRIPLE, "smooth"), 0.0),
    "monotone": (Spline(*TRIPLE, "monotone"), 0.0),
    "steps": (Spline(*TRIPLE, "constant"), 0.0),
    "one key": (Spline([0.3], [5.0]), 0.0),
    "loop": (Spline([0.1, 0.4], [1, 3], after="loop", before="loop"), 0.0),
    "pingpong": (Spline([0.1, 0.4], [1, 3], "smooth", after="pingpong"), 0.0),
    "extend": (Spline([0.1, 0.4], [1, 3], before="extend", after="extend"), 0.0),
    "bezier": (Spline(*TRIPLE, "bezier", handles=HANDLES), BOUND),
    "components": (Spline([0, 0.5, 1], [[1, 2], [3, 1], [0, 5]], "smooth"), 0.0),
}


@pytest.mark.parametrize("name", CURVES)
def test_pieces_are_the_curve(name: str) -> None:
    """Exact up to rounding; for Bezier handles within the stated share of the curve's range."""
    spline, bound = CURVES[name]
    found = pieces(spline, 0.0, 1.0)
    assert found is not None
    rng = np.random.default_rng(1)
    u = rng.uniform(-0.2, 1.2, 20_000)
    exact = np.asarray(spline(np.clip(u, 0, 1))).reshape(u.size, -1)
    error = np.abs(found(u) - exact).max()
    assert error <= bound * np.ptp(exact) + 1e-11 * np.abs(exact).max()


def test_a_curve_of_many_keys_is_left_to_a_table() -> None:
    """Each piece costs every particle some instructions, needed or not."""
    keys = np.linspace(0, 1, MOST + 2)
    assert pieces(Spline(keys, keys**2), 0.0, 1.0) is None


@pytest.mark.parametrize(
    ("interpolation", "over"),
    [("linear", "life"), ("smooth", "life"), ("constant", "life"), ("smooth", "speed")],
)
def test_kernels_follow_the_curve(interpolation: str, over: str) -> None:
    """Euler's v_n = h sum g(u_k), with u_k the share of life gone, or the speed, at step k."""
    h, n, life = 1 / 64, 48, 0.8
    times, values = [0.0, 0.3, 1.0], [2.0, 7.0, 1.0]
    curve = {
        "over": over,
        "keys": [[t, [0.0, 0.0, v]] for t, v in zip(times, values, strict=True)],
        "interpolation": interpolation,
    }
    emitter = motes.emit.Point(burst=[{"count": 40}], speed={"low": 0.0, "high": 0.1})
    sim = motes.Simulation(
        motes.Scene(
            systems=[
                motes.System(
                    "dots", life=life, emit=[emitter], force=[motes.force.Gravity(g=curve)]
                )
            ],
            integrator="euler",
            step=h,
        )
    )
    sim.run(steps=1)
    velocity = np.array(sim["dots"].velocity[:, 2], float)
    sim.run(steps=n)
    spline = Spline(times, values, interpolation)  # type: ignore[arg-type]
    for k in range(1, n + 1):
        place: Any = k * h / life if over == "life" else np.abs(velocity)
        velocity = velocity + h * spline(np.clip(place, 0.0, 1.0))
    assert sim["dots"].velocity[:, 2] == pytest.approx(velocity, rel=3e-6)


def test_the_straight_pass_finds_the_dead() -> None:
    """Who is as old as its life at a step's end is gone, even if born in that step."""
    emitter = motes.emit.Point(rate=1000.0, speed=1.0)
    short = motes.System("dots", life={"low": 0.004, "high": 0.5}, emit=[emitter])
    sim = motes.Simulation(
        motes.Scene(systems=[short], solid=[motes.solid.Plane(position=(0, 0, -1))], step=0.01)
    )
    for _ in range(60):
        sim.step()
        view = sim["dots"]
        assert np.all(view.age < view.life)
    # Births 1000/s, of which t seconds later the share (0.5 - t) / 0.496 lives.
    expected = 1000 * (0.004 + 0.496 / 2)
    assert view.age.size == pytest.approx(expected, abs=4 * np.sqrt(expected))
