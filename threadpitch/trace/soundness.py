"""Whether samples can be trusted: finite, and an angle that does not turn back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from threadpitch.compiled import compiled

FloatArray = NDArray[np.float64]

TURN = 2.0 * math.pi  # rad
LARGEST = 1e100  # of an angle or a position; what is larger is damaged, and differences and products stay finite
BLOCK = 2048  # samples: 32 KiB of angle and position stay in the processor's cache


@compiled(nogil=True)
def rising(angle: FloatArray, position: FloatArray) -> bool:
    """Every value is finite, and the angle never goes back: then only its ends can be too large unnoticed."""
    return (_suspects(angle[1:], angle[:-1], position[1:]) == 0 and abs(angle[0]) <= LARGEST
            and abs(angle[-1]) <= LARGEST and abs(position[0]) <= LARGEST)


@compiled(nogil=True, inline="never")
def _suspects(angle: FloatArray, before: FloatArray, position: FloatArray) -> int:
    """The number of samples at which the angle goes back, or a value is not finite."""
    suspects = 0
    for i in range(angle.size):  # without a branch, so that it is vectorised and runs at the speed of memory
        suspects += (not (angle[i] >= before[i])) | (not (abs(position[i]) <= LARGEST))  # true for NaN as well
    return suspects


@compiled(nogil=True)
def even(values: FloatArray, before: float, least: float, most: float) -> bool:
    """Every step from one value to the next, and from ``before`` to the first, lies from ``least`` to ``most``."""
    if values.size == 0:
        return True
    step = values[0] - before
    return least <= step <= most and _odd_steps(values[1:], values[:-1], least, most) == 0


@compiled(nogil=True, inline="never")
def _odd_steps(values: FloatArray, before: FloatArray, least: float, most: float) -> int:
    odd = 0
    for i in range(values.size):  # without a branch, as above
        step = values[i] - before[i]
        odd += (not (step >= least)) | (not (step <= most))
    return odd


@compiled(nogil=True)
def running_peak(angle: FloatArray, position: FloatArray, peak: float, limit: float, peaks: FloatArray) -> int:
    """Fills ``peaks``; the first sample that is damaged or goes back from the peak by more than the limit, or -1."""
    for i in range(angle.size):
        if not (abs(angle[i]) <= LARGEST and abs(position[i]) <= LARGEST):
            return i
        if angle[i] > peak:
            peak = angle[i]
        elif peak - angle[i] > limit:
            return i
        peaks[i] = peak
    return -1


@compiled(nogil=True)
def first_fault(angle: FloatArray, position: FloatArray, limit: float) -> tuple[int, bool]:
    """(first sample that ``running_peak`` refuses, or -1; whether the angle never goes back)."""
    peaks = np.empty(BLOCK)
    peak, last, always = -np.inf, -np.inf, True
    for first in range(0, angle.size, BLOCK):
        theta, xi = angle[first : first + BLOCK], position[first : first + BLOCK]
        if not (theta[0] >= last and peak == last and rising(theta, xi)):
            always = False
            fault = running_peak(theta, xi, peak, limit, peaks)
            if fault >= 0:
                return first + fault, False
            peak, last = peaks[theta.size - 1], theta[-1]
        else:
            peak = last = theta[-1]
    return -1, always


def damage_text(name: str, value: float) -> str:
    """That a value cannot be one, and how to mend it."""
    return f"{name} is {'NaN' if math.isnan(value) else value}; mend or leave out this sample"


def fault_text(angle: FloatArray, position: FloatArray, sample: int, peak: float) -> str:
    """What is wrong with a sample that is refused, and how to mend it; ``peak`` of the angle before it, rad."""
    for name, value in (("angle", angle[sample]), ("position", position[sample])):
        if not abs(value) <= LARGEST:
            return damage_text(name, value)
    steps = np.diff(angle)
    if peak - angle[0] < TURN and np.count_nonzero(steps < 0.0) > np.count_nonzero(steps > 0.0):
        return "the angle counts down; give it counted up in the turning direction (the negative of it)"
    return (f"the spindle turns back from {peak / TURN:.4f} to {angle[sample] / TURN:.4f} turns; end the trace before "
            "the reversal; if the angle restarts there, name the group column; if it wraps, give the period "
            "(--angle-wrap), or its unit (--angle-unit deg)")
