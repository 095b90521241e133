"""The noise of pitches: what their errors do to a contrast of them.

A pitch that is read as the distance of two grooves has the error e(n) - e(n - 1) of two crossings: neighbours share a
crossing, and their errors are correlated by -1/2. A pitch that is measured on its own has independent errors. Which of
the two a table holds is seldom written on it, so every contrast q'P is judged by the larger of its two variances,

    var(q'P) = u^2 max(sum q(n)^2, sum q(n)^2 - sum q(n) q(n + 1))
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from threadpitch.trace import FloatArray

BoolArray = NDArray[np.bool_]

_LEAST_VARIANCE = 0.02  # of a smooth direction; other errors than those of crossings are left then


def neighbours(turns: FloatArray) -> BoolArray:
    """(turns - 1,) whether the turn behind each turn follows at once: where one is missing, no crossing is shared."""
    return np.asarray(np.diff(turns) == 1.0)


def measured_variance(linked: BoolArray) -> Callable[[FloatArray], FloatArray]:
    """(directions,) variance of q'z for columns q (turns, directions) of length 1; measured pitches z of variance 1."""
    of_crossings = crossing_variance(linked)
    return lambda directions: np.maximum(1.0, of_crossings(directions))


def crossing_variance(linked: BoolArray) -> Callable[[FloatArray], FloatArray]:
    """The same for pitches whose neighbours share a crossing: 1 - sum q(n) q(n + 1)."""
    def variance(directions: FloatArray) -> FloatArray:
        shared = np.sum(directions[:-1] * directions[1:] * linked[:, np.newaxis], axis=0)
        return np.asarray(np.maximum(1.0 - shared, _LEAST_VARIANCE))

    return variance
