"""Named statistics of a simulated thread, which outcomes of a study are made of.

They are taken over the turns in the metal of the passes that make the final flanks (of all passes where the system
does not tell them), at every start angle. ``nominal.`` are those from the detectors, ``actual.`` those of the groove.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.diagnosis import UNCERTAINTY, verdict_on_groove
from threadpitch.judgement import JudgementError
from threadpitch.lathe import ACTUAL, NOMINAL, Simulation
from threadpitch.passes import Pass
from threadpitch.studies.errors import StudyError

FloatArray = NDArray[np.float64]

CALCULATORS = {"nominal": NOMINAL, "actual": ACTUAL}
CAUSE = "cause"
NEED_LIMIT = (".share_out_of_limit", ".first_good_turn")  # of a pitch


@dataclass(frozen=True)
class Judging:
    """What statistics are measured against: largest |deviation| of a good turn, standard uncertainty of a pitch, m."""

    pitch_limit: float | None = None
    uncertainty: float = UNCERTAINTY


class ThreadStatistics:
    """The statistics of one simulation, each computed when it is asked for."""

    def __init__(self, simulation: Simulation, judging: Judging) -> None:
        self._simulation = simulation
        self._judging = judging

    def __call__(self, name: str) -> float | str:
        """The statistic of this name.

        Raises:
            StudyError: the simulation does not have it: no turn was completed, or no limit was given.
        """
        if name == CAUSE:
            return self._cause()
        calculator, _, word = name.partition(".")
        return float(_OF_DEVIATIONS[word](self, self._deviations(calculator)))

    @functools.cached_property
    def limit(self) -> float:
        """The largest |deviation| of a good turn, m."""
        if self._judging.pitch_limit is None:
            raise StudyError("no limit of a pitch is given; write pitch_limit = \"5um\" into [study]")
        return self._judging.pitch_limit

    def _final(self, calculator: str) -> list[Pass]:
        passes = self._simulation.passes_of(CALCULATORS[calculator])
        return [one for one in passes if one.final_flank] or list(passes)

    def _deviations(self, calculator: str) -> list[FloatArray]:
        """P(n) - target of every final pass, (start_angles, revolutions) m; NaN where a turn is not in the metal."""
        if CALCULATORS[calculator] not in self._simulation.calculators:
            raise StudyError(f"the system has no {CALCULATORS[calculator]}")
        found = [np.where(one.in_metal, one.deviation, np.nan) for one in self._final(calculator)]
        if not any(np.isfinite(one).any() for one in found):
            reason = "no turn lies in the metal until the end; choose a longer stop time" if found else \
                self._simulation.why_no_turn()
            raise StudyError(f"{calculator}: {reason}")
        return found

    def _cause(self) -> str:
        """The verdict of ``threadpitch run``: on the pass that left the groove, measured without error."""
        self._deviations("nominal")
        try:
            return verdict_on_groove(self._simulation, uncertainty=self._judging.uncertainty).cause
        except JudgementError as error:
            raise StudyError(f"cause: {error}") from None


def _known(deviations: list[FloatArray]) -> FloatArray:
    """All that are there, (turns,)."""
    together = np.concatenate([one.ravel() for one in deviations])
    return np.asarray(together[np.isfinite(together)])


def _share_out(statistics: ThreadStatistics, deviations: list[FloatArray]) -> float:
    return float(np.mean(np.abs(_known(deviations)) > statistics.limit))


def _first_good(statistics: ThreadStatistics, deviations: list[FloatArray]) -> float:
    """Number of the first turn from which on all are good, at the worst start angle; infinite where the last is not."""
    worst = 0.0
    for rows in deviations:
        for row in rows:
            inside = np.flatnonzero(np.isfinite(row))
            bad = inside[np.abs(row[inside]) > statistics.limit]
            if bad.size and bad[-1] == inside[-1]:
                return math.inf
            if inside.size:
                worst = max(worst, float((bad[-1] if bad.size else inside[0] - 1) + 2))
    return worst


def _cumulative(statistics: ThreadStatistics, deviations: list[FloatArray]) -> float:
    """Greatest |sum of deviations| over any stretch of turns: max - min of the cumulative curve."""
    worst = 0.0
    for rows in deviations:
        for row in rows:
            curve = np.cumsum(np.concatenate([[0.0], row[np.isfinite(row)]]))
            worst = max(worst, float(np.ptp(curve)))
    return worst


_OF_DEVIATIONS: Mapping[str, Callable[[ThreadStatistics, list[FloatArray]], float]] = {
    "max_deviation": lambda _, deviations: float(np.max(np.abs(_known(deviations)))),
    "mean_deviation": lambda _, deviations: float(np.mean(_known(deviations))),
    "std_deviation": lambda _, deviations: float(np.std(_known(deviations))),
    "pitch_range": lambda _, deviations: float(np.ptp(_known(deviations))),
    "cumulative_error": _cumulative,
    "share_out_of_limit": _share_out,
    "first_good_turn": _first_good,
    "turns": lambda _, deviations: float(max(int(np.isfinite(one).sum(axis=1).max()) for one in deviations)),
}
STATISTICS = (*(f"{calculator}.{word}" for calculator in CALCULATORS for word in _OF_DEVIATIONS), CAUSE)
_NUMBERS = {"share_out_of_limit": "%", "first_good_turn": "1", "turns": "1"}
STATISTIC_UNITS = {f"{calculator}.{word}": _NUMBERS.get(word, "um") for calculator in CALCULATORS
                   for word in _OF_DEVIATIONS}  # that people read them in; "cause" is a word
