"""Reciprocal collision avoidance as it is defined: all pairs, all candidates for the best."""

from __future__ import annotations

from itertools import combinations

import numpy as np

Plane = tuple[np.ndarray, float]
"""n and c of a half-plane n . v >= c."""


def nearest_exit(v: np.ndarray, p: np.ndarray, radius: float, horizon: float) -> tuple[Plane, bool]:
    """(normal outwards, distance) of the nearest border of the velocities that collide within the
    horizon, and whether v is among them.

    They are a cone of half angle asin(radius / |p|) around p, cut off by the disc around p /
    horizon of radius / horizon: its border is two legs, from where they touch the disc, and an arc.
    """
    d = np.linalg.norm(p)
    leg = np.sqrt(d**2 - radius**2)
    candidates = []
    for side in (-1, 1):
        turn = np.array([[leg, -side * radius], [side * radius, leg]]) / d
        way = turn @ p / d
        s = max(v @ way, leg / horizon)
        candidates.append((np.linalg.norm(v - s * way), side * np.array([-way[1], way[0]])))
    w = v - p / horizon
    out = w / np.linalg.norm(w)
    if out @ p <= -radius * np.linalg.norm(p) / d:  # On the side of the disc that is no cone.
        candidates.append((abs(np.linalg.norm(w) - radius / horizon), out))
    gap, normal = min(candidates, key=lambda one: one[0])
    t = np.linspace(1e-4, horizon, 20001)
    inside = bool((np.linalg.norm(p - v * t[:, None], axis=1) < radius).any())
    return (normal, float(gap)), inside


def half_plane(
    p: np.ndarray, va: np.ndarray, vb: np.ndarray, radius: float, horizon: float
) -> Plane:
    """What a keeps to: its velocity and half of the change that leads out, along the normal."""
    (normal, gap), inside = nearest_exit(va - vb, p, radius, horizon)
    return normal, float(normal @ va + 0.5 * (gap if inside else -gap))


def best(planes: list[Plane], wanted: np.ndarray, top: float) -> np.ndarray | None:
    """The velocity nearest to the wanted one in all half-planes and the disc; None if none is.

    It is the wanted one, its foot on a border or on the circle, or where two of these meet.
    """
    tries = [wanted, wanted * min(1.0, top / max(np.linalg.norm(wanted), 1e-30))]
    for n, c in planes:
        tries.append(wanted + (c - n @ wanted) * n)
        if abs(c) <= top:
            along = np.array([-n[1], n[0]]) * np.sqrt(top**2 - c**2)
            tries += [c * n + along, c * n - along]
    for (n, c), (m, e) in combinations(planes, 2):
        both = np.array([n, m])
        if abs(np.linalg.det(both)) > 1e-12:
            tries.append(np.linalg.solve(both, [c, e]))
    allowed = [
        v for v in tries
        if np.linalg.norm(v) <= top + 1e-9 and all(n @ v >= c - 1e-9 for n, c in planes)
    ]  # fmt: skip
    return min(allowed, key=lambda v: np.linalg.norm(v - wanted)) if allowed else None
