"""Recorded angle and position: the ``Trace``.

A trace holds what Formula 1 and 2 of the pitch need: the continuous angle of the spindle and the position of the feed
axis, sample by sample. All checks are made once, when the trace is made; whoever has a trace may trust it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.trace.soundness import FloatArray, even, fault_text, first_fault

IntArray = NDArray[np.int64]

REVERSAL_LIMIT = math.radians(5.0)  # more than one count of the coarsest pulse generator in use (100 lines: 3.6 deg)
COUNT_JITTER = 1.5  # counts; an encoder that stands on an edge goes back by one
SPINDLE_SWAY = math.radians(1.0)  # what a fine encoder may go back by noise and vibration



class TraceError(ValueError):
    """A recording from which no pitch can be calculated: what, where (file and line, or sample), how to mend."""


@dataclass(frozen=True, eq=False)
class Trace:
    """Angle of the spindle and position of the feed axis, sample by sample.

    The angle counts up in the turning direction of the cut and is never wrapped. It may stand still (a quantised
    angle) and go back a little (an encoder on the edge of a count): by ``REVERSAL_LIMIT``, or, when the resolution is
    known, by ``COUNT_JITTER`` counts or ``SPINDLE_SWAY``, whichever is more. Going back further is a reversal.

    Raises:
        TraceError: unequal shapes, fewer than two samples, NaN or infinite values, time that runs back, a reversal.
    """

    angle: FloatArray  # (samples,) rad
    position: FloatArray  # (samples,) m
    time: FloatArray | None = None  # (samples,) s
    name: str = ""  # label of the group of rows
    source: str = ""  # file
    lines: IntArray | None = None  # (samples,) line of the file, from 1
    resolution: float = 0.0  # rad, one count of the encoder; 0 = not known
    notes: tuple[str, ...] = ()  # what was done to the recording
    margin: float | None = None  # rad; turns are counted from the first sample less this; None = from angle zero
    rising: bool = field(init=False)  # the angle never goes back

    def __post_init__(self) -> None:
        arrays = {"angle": self.angle, "position": self.position}
        if self.time is not None:
            arrays["time"] = self.time
        for name, values in arrays.items():
            array = samples(name, values, self.whole())
            if name != "angle" and array.size != self.angle.size:
                raise TraceError(f"{self.whole()}: {name} has {array.size} samples and angle {self.angle.size}; "
                                 "give equal lengths")
            object.__setattr__(self, name, array)
        if self.angle.size < 2:
            raise TraceError(f"{self.whole()}: {self.angle.size} samples; a pitch needs two and a whole turn between "
                             "them")
        self._check_time()
        object.__setattr__(self, "rising", self._check_angle_and_position())

    def place(self, sample: int) -> str:
        """Where a sample stands: ``file:line`` where that is known."""
        if self.lines is not None:
            return f"{self.source}:{self.lines[sample]}"
        return f"{self.source}: sample {sample}" if self.source else f"sample {sample}"

    def whole(self) -> str:
        """What to call the trace in a message."""
        group = f"group {self.name!r}" if self.name else ""
        return ", ".join(part for part in (self.source, group) if part) or "trace"

    @property
    def reversal_limit(self) -> float:
        """How far the angle may go back from its peak, rad."""
        return reversal_limit(self.resolution)

    def _check_time(self) -> None:
        if self.time is not None and (fault := time_fault(self.time)) is not None:
            raise TraceError(f"{self.place(fault[0])}: {fault[1]}")

    def _check_angle_and_position(self) -> bool:
        """Whether the angle never goes back."""
        sample, rising = first_fault(self.angle, self.position, self.reversal_limit)
        if sample >= 0:
            peak = float(self.angle[:sample].max(initial=-math.inf))
            raise TraceError(f"{self.place(sample)}: {fault_text(self.angle, self.position, sample, peak)}")
        return rising


def time_fault(time: FloatArray, before: float = -math.inf) -> tuple[int, str] | None:
    """The first sample whose time cannot be, and what is wrong with it; ``before`` is the time of the sample before."""
    if even(time, before, 0.0, math.inf) and time.size and abs(time[0]) < math.inf and abs(time[-1]) < math.inf:
        return None
    sound = np.isfinite(time)
    if not sound.all():
        return int(np.argmin(sound)), "time is not finite; mend or leave out this sample"
    back = np.flatnonzero(time < np.concatenate(([before], time[:-1])))
    if not back.size:
        return None
    sample = int(back[0])
    earlier = time[sample - 1] if sample else before
    return sample, (f"time runs back from {earlier:.9g} to {time[sample]:.9g} s; sort the samples, or separate the "
                    "recordings by a group")


def reversal_limit(resolution: float) -> float:
    """How far the angle may go back from its peak, rad; ``resolution`` of one count, rad, 0 = not known."""
    return max(COUNT_JITTER * resolution, SPINDLE_SWAY) if resolution > 0.0 else REVERSAL_LIMIT


def samples(name: str, values: ArrayLike, label: str) -> FloatArray:
    """The values (samples,) as float64, contiguous.

    Raises:
        TraceError: they are no real numbers, masked, or have another shape.
    """
    given = np.asanyarray(values)
    if np.ma.is_masked(given):
        masked = int(np.argmax(np.ma.getmaskarray(given)))
        raise TraceError(f"{label}: {name} is masked at sample {masked}; mend or leave out this sample")
    if given.dtype.kind not in "fiub":
        raise TraceError(f"{label}: {name} is not an array of numbers, but of {given.dtype}; give real numbers")
    if given.ndim != 1:
        raise TraceError(f"{label}: {name} has the shape {given.shape}; give one value per sample, (samples,)")
    return np.ascontiguousarray(given, dtype=np.float64)
