"""Limits of a thread's pitch out of its tolerance, and whether it keeps to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.report.content import Measured, Thread
from threadpitch.tables import start_angles_deg
from threadpitch.tolerance import Thread as Designation
from threadpitch.tolerance import pitch_conformity
from threadpitch.trace import FloatArray


@dataclass(frozen=True)
class Allowed:
    """What a pitch deviation may take of the tolerance of a thread."""

    designation: Designation
    share: float  # of the pitch-diameter tolerance
    engagement: float | None = None  # m; None = the longest normal one
    uncertainty: float = 0.0  # m, standard, of a measured pitch that does not bring its own


def limited(thread: Thread, allowed: Allowed) -> Thread:
    """The thread with its limits: of its measured pitches, or where there are none, of the nominal ones.

    Raises:
        ToleranceError: a share, a length or an uncertainty that makes no sense.
    """
    found = tuple((name, pitch_conformity(pitch, allowed.designation, uncertainty=uncertainty,
                                          limit_share=allowed.share, engagement=allowed.engagement))
                  for name, pitch, uncertainty in _rows(thread, allowed) if np.isfinite(pitch).any())
    return replace(thread, tolerances=found, limit=min((one.limit for _, one in found), default=None))


def _rows(thread: Thread, allowed: Allowed) -> Iterator[tuple[str, FloatArray, float]]:
    """(name, pitches (turns,) m, standard uncertainty m) of what the tolerance is held against."""
    for one in thread.measured:
        yield one.name, _in_order(one), allowed.uncertainty if one.uncertainty is None else one.uncertainty
    if not thread.measured:
        for row, angle in enumerate(start_angles_deg(thread.nominal)):
            yield f"nominal pitches, {angle:.6g} deg", np.where(thread.chosen, thread.nominal.pitch, np.nan)[row], 0.0


def _in_order(measured: Measured) -> FloatArray:
    """(turns,) m from turn 1 on; NaN where nothing was measured."""
    last = int(measured.turn.max()) if measured.turn.size else 0
    pitch = np.full(last, np.nan)
    pitch[measured.turn.astype(np.int64) - 1] = measured.pitch
    return pitch
