"""Levels A and B of an incremental encoder -> its count, with the index.

    count += +1 or -1 at every edge, in the order 00 10 11 01 of (A, B) upwards

The one-turn pulse sets the count to a multiple of the counts per turn: the nearest one, so that counts which were lost
or added by noise do not add up. The first pulse is zero. A pulse counts where it rises.
"""

from __future__ import annotations

import math

import numpy as np

from threadpitch.trace.soundness import FloatArray

_HALF = 0.5  # a level is high above it
_PHASE = np.array([0, 3, 1, 2])  # of (A, B) = 00, 01, 10, 11
_MOST_CORRECTED = 0.25  # of a turn, by which an index may correct the count


class LevelError(ValueError):
    """Levels that cannot be counted, from a ``sample`` on."""

    def __init__(self, sample: int, text: str) -> None:
        super().__init__(text)
        self.sample = sample


class Quadrature:
    """The count while the levels come; ``zero`` is the count at the first index."""

    def __init__(self, counts_per_turn: float) -> None:
        self._turn = counts_per_turn
        self._phase: int | None = None  # of the sample before
        self._count = 0.0
        self._index = True  # level of the sample before: a log that begins in a pulse has missed its edge
        self.zero: float | None = None
        self.corrected = 0.0  # counts, over all turns
        self.indices = 0

    def add(self, a: FloatArray, b: FloatArray, index: FloatArray | None) -> FloatArray:
        """The count (samples,) of the next samples, from the first sample on.

        Raises:
            LevelError: both levels change between two samples, or an index is far from a whole turn.
        """
        phases = _PHASE[2 * (a > _HALF).astype(np.int64) + (b > _HALF)]
        steps = (np.diff(phases, prepend=phases[0] if self._phase is None else self._phase) + 1) % 4 - 1
        if np.any(steps == 2):
            raise LevelError(int(np.argmax(steps == 2)), "A and B change at once, so that the direction is lost; "
                             "record them faster, or record the count")
        count: FloatArray = self._count + np.cumsum(steps)
        self._phase = int(phases[-1])
        if index is not None:
            count = count + self._corrections(count, index)
        self._count = float(count[-1])
        return count

    def note(self) -> str:
        """What was done."""
        found = "the angle is counted from the levels A and B"
        if self.indices:
            found += f", set by {self.indices} index pulses; {self.corrected:g} counts were corrected"
        return found

    def _corrections(self, count: FloatArray, index: FloatArray) -> FloatArray:
        """(samples,) what the indices so far add to the count."""
        high = index > _HALF
        rises = np.flatnonzero(high & ~np.concatenate(([self._index], high[:-1])))
        self._index = bool(high[-1])
        added = np.zeros(count.size)
        total = 0.0
        for sample in rises.tolist():
            self.indices += 1
            here = float(count[sample]) + total
            if self.zero is None:
                self.zero = here
                continue
            turns = (here - self.zero) / self._turn
            missing = math.floor(turns + 0.5) * self._turn - (here - self.zero)
            if abs(missing) > _MOST_CORRECTED * self._turn:
                raise LevelError(sample, f"the index comes {abs(turns):.3f} turns after the first one; are "
                                         f"{self._turn:g} counts per turn right?")
            added[sample:] += missing
            total += missing
            self.corrected += abs(missing)
        return added


