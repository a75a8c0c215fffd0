"""Half-planes of velocities: what one agent may do without running into another.

A half-plane is (nx, ny, c): all velocities v with n . v >= c, where n has length 1.
"""

# mypy: disallow-untyped-decorators=False
from __future__ import annotations

from typing import Any

import numpy as np

from motes.jit import STRICT, jit


@jit(flags=STRICT)
def reciprocal(
    px: Any, py: Any, vx: Any, vy: Any, ux: Any, uy: Any, radius: Any, horizon: Any, step: Any
) -> Any:
    """The half-plane that agent a keeps to if b does its half: (nx, ny, c).

    p = x_b - x_a is the way to b [m], v = v_a - v_b the relative velocity, u = v_a [m/s], `radius`
    the sum of both radii [m]. The velocities that lead to a collision within `horizon` [s] are a
    cone cut off by a disc; w is the smallest change of v that leaves it, and a takes half of it:
    n . v_new >= n . (u + w / 2). Agents that overlap part within `step` [s].

    Source: van den Berg, Guy, Lin and Manocha, Reciprocal n-body collision avoidance, Robotics
    Research (2011), equations 2 to 6.
    """
    distance2, radius2 = px * px + py * py, radius * radius
    time = horizon if distance2 > radius2 else step
    wx, wy = vx - px / time, vy - py / time
    speed2, along = wx * wx + wy * wy, wx * px + wy * py
    if distance2 <= radius2 or (along < 0.0 and along * along > radius2 * speed2):
        speed = np.sqrt(speed2)  # Out of the disc.
        if speed > 0.0:
            nx, ny = wx / speed, wy / speed
        else:
            nx, ny = 1.0, 0.0
        change = radius / time - speed
    else:  # Out through the nearer leg of the cone.
        side = 1.0 if px * wy - py * wx > 0.0 else -1.0
        leg = np.sqrt(distance2 - radius2)
        nx = -(side * px * radius + py * leg) / distance2 * side
        ny = (px * leg - side * py * radius) / distance2 * side
        change = -(vx * nx + vy * ny)
    return nx, ny, nx * ux + ny * uy + 0.5 * change


@jit(flags=STRICT)
def contact(px: Any, py: Any, radius: Any, step: Any) -> Any:
    """The half-plane in which an agent uses up at most half of its gap to b within `step` [s].

    Along n, from b to a: n . v_a >= -(|p| - radius) / (2 step), or 0 where they overlap. Where both
    keep to theirs they cannot overlap at the step's end; standing still always keeps to it.
    """
    distance = np.sqrt(px * px + py * py)
    if not distance > 0.0:
        return 1.0, 0.0, -np.inf
    return -px / distance, -py / distance, min(0.5 * (radius - distance) / step, 0.0)
