"""Movements per revolution as a table, with their statistics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.trace import FloatArray

BoolArray = NDArray[np.bool_]


class PitchError(ValueError):
    """No pitch can be calculated for these start angles from this trace."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """Least, greatest and mean movement per revolution over the turns that are there; NaN where there is none."""

    minimum: FloatArray  # (start_angles,) m
    maximum: FloatArray  # (start_angles,) m
    mean: FloatArray  # (start_angles,) m


@dataclass(frozen=True, eq=False)
class PitchTable:
    """Movement per revolution P(n), for every start angle: ``pitch[k, n - 1]``.

    P(n) lies between theta_S + 360 (n - 1 + turns_before) and theta_S + 360 (n + turns_before) of the angle as given.
    """

    start_angles: FloatArray  # (start_angles,) rad
    pitch: FloatArray  # (start_angles, revolutions) m, positive in the direction of the cut; NaN outside the trace
    crossings: FloatArray  # (start_angles, revolutions + 1) m, xi as given; NaN outside the trace
    extrapolated: BoolArray  # (start_angles,) the first crossing lies before the first sample
    turns_before: int = 0  # whole turns between angle zero and the beginning of n = 1
    notes: tuple[str, ...] = ()  # what was done to the recording
    uncertainty: FloatArray | None = None  # (start_angles, revolutions) m, standard uncertainty of P(n), where known

    @classmethod
    def of_pitches(cls, pitch: ArrayLike, start_angles: ArrayLike) -> PitchTable:
        """A table of pitches (start_angles, revolutions) m that were calculated elsewhere; its crossings are NaN."""
        movement = np.atleast_2d(np.asarray(pitch, dtype=np.float64))
        starts = np.atleast_1d(np.asarray(start_angles, dtype=np.float64))
        if movement.shape[0] != starts.size:
            raise PitchError(f"{movement.shape[0]} rows of pitches, {starts.size} start angles; give one row for each")
        crossings = np.full((movement.shape[0], movement.shape[1] + 1), np.nan)
        return cls(starts, movement, crossings, np.zeros(starts.size, dtype=np.bool_))

    def standstill(self) -> str:
        """Which turns the position stood still in: a sensor that is stuck; empty for none."""
        still = (self.pitch == 0.0).any(axis=0)
        if not still.any():
            return ""
        if not (np.abs(self.pitch) > 0.0).any():
            return "the position does not move in any turn: is its sensor stuck, or is it another axis?"
        turns = np.flatnonzero(still) + 1
        which = f"turn {turns[0]}" if turns.size == 1 else f"{turns.size} turns, the first of them {turns[0]}"
        return (f"the position does not move in {which}: is its sensor stuck, or is the axis not threading there "
                "(--synchronous finds the passes)?")

    @property
    def minimum(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.minimum

    @property
    def maximum(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.maximum

    @property
    def mean(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.mean

    @cached_property
    def statistics(self) -> Statistics:
        """Over all turns; those of a part of the thread are ``statistics(table.pitch[:, first:last])``."""
        return statistics(self.pitch)


def statistics(pitch: FloatArray) -> Statistics:
    """Min, max and mean of P(n) over n, for pitches (start_angles, revolutions) m; NaN does not count."""
    known = ~np.isnan(pitch)
    count = known.sum(axis=1)
    none = np.where(count > 0, 0.0, np.nan)  # (start_angles,) NaN where no turn is there
    return Statistics(
        minimum=np.min(pitch, axis=1, where=known, initial=np.inf) + none,
        maximum=np.max(pitch, axis=1, where=known, initial=-np.inf) + none,
        mean=np.sum(pitch, axis=1, where=known) / np.maximum(count, 1) + none,
    )
