"""Values drawn once for each particle at its birth."""

from __future__ import annotations

from typing import Any

import numpy as np

from motes.control.control import Control, Values


class Uniform(Control):
    """Uniform between `low` and `high`, each component on its own."""

    scope = "birth"

    def __init__(self, low: Values, high: Values, document: Any) -> None:
        self.low, self.high = np.asarray(low, float), np.asarray(high, float)
        self.width = self.low.size
        self._document = document

    def document(self) -> Any:
        """`{ mean = m, spread = s }` or `{ low = a, high = b }`, as it was written."""
        return self._document

    def bounds(self) -> tuple[float, float]:
        """The extremes of the interval."""
        return float(min(self.low.min(), self.high.min())), float(
            max(self.low.max(), self.high.max())
        )


class Normal(Control):
    """Normal (Gaussian), each component on its own, cut off at four standard deviations.

    The cut keeps every draw within known bounds, so that a range can be checked before the run.
    Draws come in pairs (Box and Muller 1958) with a radius of at most 4, which is exact for the
    truncated pair and leaves 99.7 % of the variance.
    """

    scope = "birth"

    def __init__(self, mean: Values, sigma: Values, document: Any) -> None:
        self.mean, self.sigma = np.asarray(mean, float), np.asarray(sigma, float)
        self.width = self.mean.size
        self._document = document

    def document(self) -> Any:
        """`{ normal = [mean, sigma] }`."""
        return self._document

    def bounds(self) -> tuple[float, float]:
        """Four standard deviations to both sides."""
        return float((self.mean - 4 * self.sigma).min()), float((self.mean + 4 * self.sigma).max())


class Choice(Control):
    """One of several values, each as likely."""

    scope = "birth"

    def __init__(self, values: Values, document: Any) -> None:
        self.values = np.asarray(values, float)
        self.width = self.values.shape[1]
        self._document = document

    def document(self) -> Any:
        """`{ choice = [a, b, c] }`."""
        return self._document

    def bounds(self) -> tuple[float, float]:
        """Smallest and largest component of any choice."""
        return float(self.values.min()), float(self.values.max())
