"""Inputs that follow what feeds them inside of a step: the polynomial through its last values.

Of order 0 the newest value is held; of order k the polynomial goes through the k + 1 newest values that the source had
at its communication points. The order is lower while there are fewer of them, after the start. Both functions are
written so that Numba compiles them: the plain loop and the kernel have one definition.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HIGHEST_ORDER = 2
_KEPT = HIGHEST_ORDER + 1  # samples of each source


class Samples(NamedTuple):
    """The newest values of n sources, newest first: ``counts`` (n,), ``times`` and ``values`` (n, kept)."""

    counts: NDArray[np.int64]
    times: NDArray[np.float64]
    values: NDArray[np.float64]

    @classmethod
    def of(cls, sources: int) -> Samples:
        """None yet of any source."""
        return cls(np.zeros(sources, np.int64), np.zeros((sources, _KEPT)), np.zeros((sources, _KEPT)))


def add_sample(samples: Samples, number: int, time: float, value: float) -> None:
    """Take in a source's value; it replaces one of the same time, as iterations bring several."""
    counts, times, values = samples
    if counts[number] > 0 and times[number, 0] == time:
        values[number, 0] = value
        return
    for i in range(_KEPT - 1, 0, -1):
        times[number, i] = times[number, i - 1]
        values[number, i] = values[number, i - 1]
    times[number, 0] = time
    values[number, 0] = value
    counts[number] = min(counts[number] + 1, _KEPT)


def polynomial(samples: Samples, number: int, order: int, time: float) -> tuple[float, float, float]:
    """Value, first and second derivative at ``time`` of the polynomial through the newest samples, in Newton's form.

    p(t) = v0 + d01 (t - t0) + d012 (t - t0)(t - t1),  d01 = (v0 - v1)/(t0 - t1),  d012 = (d01 - d12)/(t0 - t2)
    """
    count = min(samples.counts[number], order + 1)
    v0, t0 = float(samples.values[number, 0]), float(samples.times[number, 0])
    if count < 2:
        return v0, 0.0, 0.0
    v1, t1 = float(samples.values[number, 1]), float(samples.times[number, 1])
    slope = (v0 - v1) / (t0 - t1)
    if count < 3:
        return v0 + slope * (time - t0), slope, 0.0
    v2, t2 = float(samples.values[number, 2]), float(samples.times[number, 2])
    curvature = (slope - (v1 - v2) / (t1 - t2)) / (t0 - t2)
    value = v0 + slope * (time - t0) + curvature * (time - t0) * (time - t1)
    return value, slope + curvature * ((time - t0) + (time - t1)), 2.0 * curvature
