"""How potentials end at a cutoff, and what two species have between them."""

from __future__ import annotations

import math
from typing import Any

TRUNCATIONS = ("plain", "shift", "force_shift")
MIXING = ("lorentz_berthelot", "geometric")


def cut_off(p: Any, at_cut: float, slope: float) -> dict[str, float]:
    """`shift` and `slope` of U(r) - shift + slope r, from potential and force at the cutoff.

    Source: Allen and Tildesley (2017), equations 5.10 and 5.11.
    """
    if p.truncation == "plain":
        return {"shift": 0.0, "slope": 0.0}
    if p.truncation == "shift":
        return {"shift": at_cut, "slope": 0.0}
    return {"shift": at_cut + slope * p.cutoff, "slope": slope}


def mixed_pair(p: Any, a: str, b: str) -> dict[str, float]:
    """Epsilon and sigma between two systems, by the rules of Lorentz and Berthelot.

    Source: Allen and Tildesley (2017), equations 1.31 and 1.32.
    """
    species = dict(p.species)
    own = [{"epsilon": p.epsilon, "sigma": p.sigma, **species.get(name, {})} for name in (a, b)]
    sigmas = [one["sigma"] for one in own]
    arithmetic = p.mixing == "lorentz_berthelot"
    return {
        "epsilon": math.sqrt(own[0]["epsilon"] * own[1]["epsilon"]),
        "sigma": sum(sigmas) / 2 if arithmetic else math.sqrt(sigmas[0] * sigmas[1]),
    }
