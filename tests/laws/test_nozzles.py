"""A head with nozzles: births take turns, and jets leave as its angles say."""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import motes
from motes.emit.nozzles import Nozzles


def head(**changes: float) -> SimpleNamespace:
    still = {"count": 4.0, "heading": 0.0, "radius": 0.2, "elevation": 30.0, "speed": 5.0}
    return SimpleNamespace(**{**still, "around": 0.0, "angle": 0.0, **changes})


@given(
    k=st.integers(0, 10**6),
    count=st.integers(1, 12),
    heading=st.floats(-720, 720),
    elevation=st.floats(-89, 89),
)
def test_birth_k_leaves_nozzle_k_mod_count_along_its_jet(
    k: int, count: int, heading: float, elevation: float
) -> None:
    """Azimuth heading + 360 (k mod count) / count, outward, at the elevation, at the speed."""
    p = head(count=float(count), heading=heading, elevation=elevation)
    x, y, z, vx, vy, vz = Nozzles.birth.py_func(p, (0.3, 0.6), 0.0, k)
    azimuth = radians(heading + 360 * (k % count) / count)
    assert cos(atan2(y, x) - azimuth) == pytest.approx(1)
    assert cos(atan2(vy, vx) - azimuth) == pytest.approx(1)
    assert (hypot(x, y), z) == (pytest.approx(0.2), 0.0)
    assert degrees(atan2(vz, hypot(vx, vy))) == pytest.approx(elevation)
    assert hypot(vx, vy, vz) == pytest.approx(5.0)


@given(u=st.floats(0, 1, exclude_max=True), v=st.floats(0, 1, exclude_max=True))
def test_a_jet_stays_in_its_cone(u: float, v: float) -> None:
    middle = Nozzles.birth.py_func(head(), (0.0, 0.0), 0.0, 0)[3:]
    drop = Nozzles.birth.py_func(head(angle=10.0), (u, v), 0.0, 0)[3:]
    assert sum(a * b for a, b in zip(middle, drop, strict=True)) >= 25 * cos(radians(10)) - 1e-9


def test_a_turning_nozzle_throws_sideways() -> None:
    """`around` is counterclockwise: at azimuth 90 degrees it points to -x."""
    *_, vx, vy, _ = Nozzles.birth.py_func(head(heading=90.0, around=0.7), (0.0, 0.0), 0.0, 0)
    assert (vx, vy) == (pytest.approx(-0.7), pytest.approx(5 * cos(radians(30))))


def test_compiled_births_take_turns_too() -> None:
    """Four drops in the first second, without forces: one straight away from each nozzle."""
    nozzles = motes.emit.Nozzles(rate=4, radius=1.0, speed=2.0, elevation=0)
    simulation = motes.Simulation(motes.Scene(systems=[motes.System("water", emit=[nozzles])]))
    simulation.run(until=1.5)
    position = simulation["water"].position
    azimuths = sorted(round(degrees(atan2(y, x))) % 360 for x, y, _ in position[:4])
    assert azimuths == [0, 90, 180, 270]
