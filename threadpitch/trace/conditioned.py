"""Conditioned samples of a group: what only has to be scaled is scaled where it is used, in the processor's cache."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from threadpitch.trace.recording import IntArray
from threadpitch.trace.soundness import FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Neighbouring samples of one group: angle = angle_factor angle_values, counted up; the position likewise.

    All arrays are (samples,).
    """

    angle_values: FloatArray
    angle_factor: float  # rad per unit
    position_values: FloatArray
    position_factor: float  # m per unit
    time: FloatArray | None = None  # s
    lines: IntArray | None = None  # of the file, from 1

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.angle_values.size

    @cached_property
    def angle(self) -> FloatArray:
        """rad."""
        return scaled(self.angle_values, self.angle_factor)

    @cached_property
    def position(self) -> FloatArray:
        """m."""
        return scaled(self.position_values, self.position_factor)

    def part(self, which: slice | NDArray[np.bool_]) -> Samples:
        """Some of the samples."""
        return Samples(self.angle_values[which], self.angle_factor, self.position_values[which], self.position_factor,
                       None if self.time is None else self.time[which],
                       None if self.lines is None else self.lines[which])


def scaled(values: FloatArray, factor: float) -> FloatArray:
    """``factor values``; the values themselves where the factor is 1. What becomes infinite, a trace refuses."""
    if factor == 1.0:
        return values
    with np.errstate(over="ignore", invalid="ignore"):
        return values * factor


def joined(parts: Sequence[Samples]) -> Samples:
    """Neighbouring samples as one."""
    times = [part.time for part in parts if part.time is not None]
    lines = [part.lines for part in parts if part.lines is not None]
    return Samples(np.concatenate([part.angle for part in parts]), 1.0,
                   np.concatenate([part.position for part in parts]), 1.0,
                   np.concatenate(times) if times else None, np.concatenate(lines) if lines else None)
