"""Recorded angle and position: the ``Trace``.

A trace holds what Formula 1 and 2 of the pitch need: the continuous angle of the spindle and the position of the feed
axis, sample by sample. All checks are made once, when the trace is made; whoever has a trace may trust it.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.compiled import compiled

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TURN = 2.0 * math.pi  # rad
REVERSAL_LIMIT = math.radians(5.0)  # more than one count of the coarsest pulse generator in use (100 lines: 3.6 deg)
COUNT_JITTER = 1.5  # counts; an encoder that stands on an edge goes back by one
SPINDLE_SWAY = math.radians(1.0)  # what a fine encoder may go back by noise and vibration
TWO_THREADS_FROM = 1 << 20  # samples; below that a second thread costs more than it gives
LARGEST = 1e100  # of an angle or a position; what is larger is damaged, and differences and products stay finite

_SOUND, _ANGLE_DAMAGED, _POSITION_DAMAGED, _REVERSAL = 0, 1, 2, 3


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
    rising: bool = field(init=False)  # the angle never goes back

    def __post_init__(self) -> None:
        arrays = {"angle": self.angle, "position": self.position}
        if self.time is not None:
            arrays["time"] = self.time
        for name, values in arrays.items():
            object.__setattr__(self, name, self._samples(name, values))
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
        return max(COUNT_JITTER * self.resolution, SPINDLE_SWAY) if self.resolution > 0.0 else REVERSAL_LIMIT

    def _samples(self, name: str, values: ArrayLike) -> FloatArray:
        try:
            array = np.ascontiguousarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise TraceError(f"{self.whole()}: {name} is not an array of numbers") from None
        shape, wanted = np.shape(values), np.shape(self.angle)
        if len(shape) != 1:
            raise TraceError(f"{self.whole()}: {name} has the shape {shape}; give one value per sample, (samples,)")
        if shape != wanted:
            raise TraceError(f"{self.whole()}: {name} has {shape[0]} samples and angle {wanted[0]}; give equal lengths")
        if array.size < 2:
            raise TraceError(f"{self.whole()}: {array.size} samples; a pitch needs two and a whole turn between them")
        return array

    def _check_time(self) -> None:
        if self.time is None:
            return
        sound = np.isfinite(self.time)
        if not sound.all():
            raise TraceError(f"{self.place(int(np.argmin(sound)))}: time is not finite; mend or leave out this sample")
        back = self.time[1:] < self.time[:-1]
        if back.any():
            sample = int(np.argmax(back)) + 1
            raise TraceError(f"{self.place(sample)}: time runs back from {self.time[sample - 1]:.9g} to "
                             f"{self.time[sample]:.9g} s; sort the samples, or separate the recordings by a group")

    def _check_angle_and_position(self) -> bool:
        """Whether the angle never goes back; the first pass is branchless, the second finds what and where."""
        if _ends_are_sound(self.angle, self.position) and _suspects(self.angle, self.position) == 0:
            return True
        fault, sample, peak = _first_fault(self.angle, self.position, self.reversal_limit)
        if fault in (_ANGLE_DAMAGED, _POSITION_DAMAGED):
            name = "angle" if fault == _ANGLE_DAMAGED else "position"
            value = getattr(self, name)[sample]
            raise TraceError(f"{self.place(sample)}: {name} is {'NaN' if math.isnan(value) else value}; "
                             "mend or leave out this sample")
        if fault == _REVERSAL:
            raise TraceError(f"{self.place(sample)}: {self._reversal(self.angle[sample], peak)}")
        return False

    def _reversal(self, angle: float, peak: float) -> str:
        rises = int(np.count_nonzero(self.angle[1:] > self.angle[:-1]))
        falls = int(np.count_nonzero(self.angle[1:] < self.angle[:-1]))
        if falls > rises:
            return "the angle counts down; give it counted up in the turning direction (the negative of it)"
        return (f"the spindle turns back from {peak / TURN:.4f} to {angle / TURN:.4f} turns; end the trace before the "
                "reversal; if the angle restarts there, name the group column; if it wraps, make it continuous")


def _ends_are_sound(angle: FloatArray, position: FloatArray) -> bool:
    """The kernel compares neighbours: of an angle that never falls only the ends can be too large unnoticed."""
    return bool(abs(angle[0]) <= LARGEST and abs(angle[-1]) <= LARGEST and abs(position[0]) <= LARGEST)


def _suspects(angle: FloatArray, position: FloatArray) -> int:
    """The number of samples at which the angle goes back, or a value is not finite."""
    if angle.size < TWO_THREADS_FROM:
        return _count_suspects(angle, position)
    middle = angle.size // 2
    with ThreadPoolExecutor(max_workers=1) as second:
        rest = second.submit(_count_suspects, angle[middle:], position[middle:])
        return _count_suspects(angle[: middle + 1], position[: middle + 1]) + rest.result()


@compiled(nogil=True)
def _count_suspects(angle: FloatArray, position: FloatArray) -> int:
    """The first sample is compared with none."""
    suspects = 0
    for i in range(1, angle.size):  # without a branch, so that it is vectorised and runs at the speed of memory
        suspects += not (angle[i] >= angle[i - 1])  # true for NaN as well
        suspects += not (abs(position[i]) <= LARGEST)
    return suspects


@compiled(nogil=True)
def _first_fault(angle: FloatArray, position: FloatArray, limit: float) -> tuple[int, int, float]:
    """(fault, sample, peak of the angle up to there, rad)."""
    peak = angle[0]
    for i in range(angle.size):
        if not abs(angle[i]) <= LARGEST:
            return _ANGLE_DAMAGED, i, peak
        if not abs(position[i]) <= LARGEST:
            return _POSITION_DAMAGED, i, peak
        if angle[i] > peak:
            peak = angle[i]
        elif peak - angle[i] > limit:
            return _REVERSAL, i, peak
    return _SOUND, 0, peak
