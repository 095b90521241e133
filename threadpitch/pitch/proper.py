"""Which turns of a recording are the thread: the start of the feed and the retraction lie far outside of it."""

from __future__ import annotations

import numpy as np

from threadpitch.pitch.table import BoolArray
from threadpitch.trace import FloatArray

_FAR = 6.0  # standard deviations from the median, beyond which a turn is an arrow
_NORMAL = 1.4826  # standard deviation over the median absolute deviation of normal noise


def usual(values: FloatArray) -> BoolArray:
    """(values,) which of them, all known, are not far outside of what the others do: six standard deviations."""
    off = np.abs(values - np.median(values)) if values.size else values
    spread = _NORMAL * float(np.median(off)) if values.size else 0.0
    return np.asarray(off <= _FAR * spread) if spread > 0.0 else np.ones(values.shape, dtype=np.bool_)


def thread_proper(pitch: FloatArray) -> BoolArray:
    """(start_angles, revolutions) turns but for those at both ends that are far outside of what the others do.

    So the start of the feed and the retraction do not hide the thread; what happens between them is never left out.
    """
    chosen = ~np.isnan(pitch)
    for row, known in zip(pitch, chosen, strict=True):
        places = np.flatnonzero(known)
        near = places[usual(row[places])]
        known[:] = known & (np.arange(row.size) >= near[0]) & (np.arange(row.size) <= near[-1]) if near.size else known
    return chosen
