"""What a pitch deviation takes of the pitch-diameter tolerance, and whether that is allowed.

    d(d2) = dP cot(flank angle)              1.732 dP for threads of 60 degrees
    dP    = largest |sum of (P(n) - lead)| between two grooves within the length of engagement

ISO 965-1 has no tolerance of the pitch itself: its deviation takes part of T_d2, and how much it may take is the
user's limit. The verdict follows ISO 14253-1: conform where deviation and expanded uncertainty together stay within
the limit, not conform where the deviation exceeds it by more than the expanded uncertainty, else not decidable.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.tolerance.designation import Thread, ToleranceError
from threadpitch.tolerance.limits import external_limits, internal_limits, normal_engagement
from threadpitch.trace import FloatArray

CONFORM, NOT_CONFORM, NOT_DECIDABLE = "conform", "not conform", "not decidable"
QUARTER = 0.25  # of T_d2, the limit where none is given
COVERAGE = 2.0  # of the expanded uncertainty: about 95 %
COTANGENT = math.sqrt(3.0)  # of the flank angle of 30 degrees, ISO 68-1 and ASME B1.1


@dataclass(frozen=True)
class PitchConformity:
    """Deviations of a thread's pitch against its pitch-diameter tolerance; lengths in m."""

    verdict: str  # conform, not conform, not decidable
    tolerance: float  # T_d2 of the external, T_D2 of the internal thread
    limit: float  # largest cumulative deviation that the limit allows
    cumulative: float  # largest cumulative deviation between two grooves within the engagement
    cumulative_turns: tuple[int, int]  # between the beginning of the first turn and the end of the second
    cumulative_share: float  # of the tolerance: d(d2) / T_d2
    per_turn: float  # largest |P(n) - lead|
    per_turn_share: float  # of the tolerance
    expanded_uncertainty: float  # of the cumulative deviation, k = 2
    engagement: float  # length over which deviations add up


def pitch_conformity(pitch: ArrayLike, thread: Thread, *, uncertainty: float = 0.0, limit_share: float = QUARTER,
                     engagement: float | None = None) -> PitchConformity:
    """Whether pitches (turns,) m, movements per revolution, keep to a share of the thread's pitch-diameter tolerance.

    Args:
        pitch: P(n); NaN where a turn is missing: deviations are not added up across it.
        thread: of a designation; where it names both, the external thread counts.
        uncertainty: standard uncertainty of one pitch, m. Those of several turns add up as squares: u sqrt(turns).
        limit_share: of T_d2 that the cumulative deviation may take.
        engagement: m; the longest normal length of engagement where none is given.

    Raises:
        ToleranceError: no pitch, or a limit, an uncertainty or a length that makes no sense.
    """
    deviations = np.atleast_1d(np.asarray(pitch, dtype=np.float64)) - thread.lead
    if deviations.ndim != 1 or not np.isfinite(deviations).any() or np.isinf(deviations).any():
        raise ToleranceError("there is no pitch to judge; give (turns,) in m, NaN where one is missing")
    length = normal_engagement(thread)[1] if engagement is None else engagement
    if not 0.0 < limit_share <= 1.0 or not 0.0 <= uncertainty < math.inf or not 0.0 < length < math.inf:
        raise ToleranceError(f"limit {limit_share:g} of the tolerance, uncertainty {uncertainty:g} m, engagement "
                             f"{length:g} m; give a limit from 0 to 1 and lengths that are not negative")
    tolerance = (internal_limits if thread.external is None else external_limits)(thread).pitch_tolerance
    cumulative, turns = worst_cumulative(deviations, max(1, math.floor(length / thread.lead + 1e-9)))
    per_turn = float(np.nanmax(np.abs(deviations)))
    limit = limit_share * tolerance / COTANGENT
    expanded = COVERAGE * uncertainty * math.sqrt(turns[1] - turns[0] + 1)
    return PitchConformity(_verdict(cumulative, expanded, limit), tolerance, limit, cumulative, turns,
                           COTANGENT * cumulative / tolerance, per_turn, COTANGENT * per_turn / tolerance, expanded,
                           length)


def worst_cumulative(deviations: FloatArray, most_turns: int) -> tuple[float, tuple[int, int]]:
    """(largest |sum of deviations| over at most so many neighbouring turns, its first and last turn from 1)."""
    worst, turns = 0.0, (1, 1)
    known = ~np.isnan(deviations)
    sums = np.concatenate([[0.0], np.cumsum(np.where(known, deviations, 0.0))])
    missing = np.concatenate([[0], np.cumsum(~known)])
    for count in range(1, min(most_turns, deviations.size) + 1):
        moved = np.abs(sums[count:] - sums[:-count])
        moved[missing[count:] != missing[:-count]] = 0.0
        first = int(np.argmax(moved))
        if moved[first] > worst:
            worst, turns = float(moved[first]), (first + 1, first + count)
    return worst, turns


def _verdict(deviation: float, expanded: float, limit: float) -> str:
    if deviation + expanded <= limit:
        return CONFORM
    return NOT_CONFORM if deviation - expanded > limit else NOT_DECIDABLE
