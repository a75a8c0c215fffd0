"""Reynolds' three rules as a double loop over all pairs: the slow, obvious version."""

from __future__ import annotations

from typing import Any

import numpy as np


def boids(
    x: np.ndarray, v: np.ndarray, rules: dict[str, dict[str, float]], box: float | None = None
) -> np.ndarray:
    """Accelerations (n, 3) of boids at x with v, in open space or a periodic box."""
    a = np.zeros_like(x)
    for i in range(len(x)):
        sums: Any = {name: [np.zeros(3), 0.0] for name in rules}
        for j in range(len(x)):
            r = x[i] - x[j]
            if box is not None:
                r = r - box * np.round(r / box)
            d = np.linalg.norm(r)
            for name, rule in rules.items():
                if i == j or d > rule["radius"]:
                    continue
                w = 1 - d / rule["radius"]
                if name == "separation":
                    sums[name][0] += w * r / max(d, 1e-15)
                    continue
                angle = rule["angle"]
                ahead = -np.dot(v[i], r)
                if angle < 180 and ahead < np.cos(np.radians(angle)) * np.linalg.norm(v[i]) * d:
                    continue
                sums[name][0] += w * (v[j] - v[i] if name == "alignment" else -r)
                sums[name][1] += w
        a[i] += rules["separation"]["strength"] * sums["separation"][0]
        total, weight = sums["alignment"]
        a[i] += rules["alignment"]["rate"] * total / (weight + 0.05)
        total, weight = sums["cohesion"]
        cohesion = rules["cohesion"]
        a[i] += cohesion["strength"] * total / (cohesion["radius"] * (weight + 0.05))
    return a
