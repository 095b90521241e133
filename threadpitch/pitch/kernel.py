"""The one walk over the samples: every sample checked, every crossing found while it lies in the processor's cache.

A level is reached at the first sample j whose running peak is at least the level. There the angle itself is the peak,
and angle[j - 1] < level <= angle[j], so that

    xi(level) = xi_j - (theta_j - level) / (theta_j - theta_i) (xi_j - xi_i),  i = j - 1

which needs no other samples: the result is the same, bit for bit, however the samples are cut into pieces.
"""

from __future__ import annotations

import math

import numpy as np

from threadpitch.compiled import compiled
from threadpitch.trace import TURN, FloatArray, IntArray
from threadpitch.trace.soundness import BLOCK, rising, running_peak

ROUNDING = 8.0 * float(np.finfo(np.float64).eps)  # of an angle that was converted to rad

ANGLE, POSITION, PEAK = 0, 1, 2  # of the sample before the piece


@compiled(nogil=True)
def advance(angle: FloatArray, position: FloatArray, factors: tuple[float, float], last: FloatArray, limit: float,
            starts: FloatArray, before: int, reached: IntArray, crossings: FloatArray) -> int:
    """Adds a piece of a recording to ``crossings`` (start_angles, columns) m; the sample that is refused, or -1.

    ``factors``: rad per unit of the angle, m per unit of the position. ``last`` (angle, position, peak) is the state of
    the sample before the piece, ``reached`` (start_angles,) the next column of each start angle; both move on.
    ``limit``: how far the angle may go back from its peak, rad.
    """
    scratch, angles, positions = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    for first in range(0, angle.size, BLOCK):
        end = min(first + BLOCK, angle.size)
        theta = _scaled(angle[first:end], factors[0], angles)
        xi = _scaled(position[first:end], factors[1], positions)
        if last[PEAK] == last[ANGLE] and theta[0] >= last[ANGLE] and rising(theta, xi):
            _cross(theta, theta, xi, last, starts, before, reached, crossings)
            last[PEAK] = theta[-1]
        else:
            damaged = running_peak(theta, xi, last[PEAK], limit, scratch)
            if damaged >= 0:
                return first + damaged
            peak = scratch[: end - first]
            _cross(peak, theta, xi, last, starts, before, reached, crossings)
            last[PEAK] = peak[-1]
        last[ANGLE], last[POSITION] = theta[-1], xi[-1]
    return -1


@compiled(nogil=True, inline="never")
def _scaled(values: FloatArray, factor: float, scratch: FloatArray) -> FloatArray:
    if factor == 1.0:
        return values
    for i in range(values.size):
        scratch[i] = values[i] * factor
    return scratch[: values.size]


@compiled(nogil=True)
def threshold(start: float, before: int, column: int) -> float:
    """A level less so little that an angle counts as on it: a count converted to rad is not late by rounding."""
    level = start + TURN * (before + column)
    return level - ROUNDING * max(abs(level), TURN)


@compiled(nogil=True)
def columns_reached(angle: float, starts: FloatArray, before: int) -> IntArray:
    """Number of levels (start_angles,) that an angle has reached."""
    reached = np.zeros(starts.size, np.int64)
    for k in range(starts.size):
        column = max(math.floor((angle - starts[k]) / TURN) - before - 1, 0)
        while threshold(starts[k], before, column) <= angle:
            column += 1
        reached[k] = column
    return reached


@compiled(nogil=True)
def movements(crossings: FloatArray, direction: float, pitch: FloatArray) -> None:
    """P(n) = direction (xi_n - xi_(n-1)); zero without a sign."""
    for k in range(crossings.shape[0]):
        for n in range(pitch.shape[1]):
            pitch[k, n] = direction * (crossings[k, n + 1] - crossings[k, n]) + 0.0


@compiled(nogil=True)
def first_above(angle: FloatArray, value: float) -> int:
    """First sample above the value; the number of samples if there is none."""
    for i in range(angle.size):
        if angle[i] > value:
            return i
    return angle.size


@compiled(nogil=True, error_model="numpy")
def _cross(peak: FloatArray, theta: FloatArray, xi: FloatArray, last: FloatArray, starts: FloatArray, before: int,
           reached: IntArray, crossings: FloatArray) -> None:
    """All crossings in one block; each is guessed by the mean speed, so that none waits for the one before."""
    size, end = peak.size, peak[peak.size - 1]
    movement = end - peak[0]
    per_angle = (size - 1) / movement if movement > 0.0 else 0.0
    for k in range(starts.size):
        column = reached[k]
        while column < crossings.shape[1]:
            level = starts[k] + TURN * (before + column)
            slack = ROUNDING * max(abs(level), TURN)
            if level - slack > end:
                break
            j = _first_reaching(peak, level - slack, (level - peak[0]) * per_angle)
            late = theta[j] - level
            if late <= slack:  # sample j lies on the level and is taken as it is
                crossings[k, column] = xi[j]
            elif j > 0:
                crossings[k, column] = xi[j] - late / (theta[j] - theta[j - 1]) * (xi[j] - xi[j - 1])
            else:
                crossings[k, column] = xi[0] - late / (theta[0] - last[ANGLE]) * (xi[0] - last[POSITION])
            column += 1
        reached[k] = column


@compiled(nogil=True)
def _first_reaching(peak: FloatArray, level: float, guess: float) -> int:
    """First j with peak[j] >= level, which the last of ``peak`` is."""
    size = peak.size
    if 1.0 <= guess < size - 2:  # mostly it is next to the guess: found without a branch that is hard to foresee
        low = int(guess) - 1
        j: int = low + (peak[low] < level) + (peak[low + 1] < level) + (peak[low + 2] < level)
        if peak[j] >= level and (j == 0 or peak[j - 1] < level):
            return j
    j = int(min(max(guess, 0.0), size - 1.0))
    step = 1
    if peak[j] < level:
        low = j + 1
        while peak[min(j + step, size - 1)] < level:
            low, step = j + step + 1, 2 * step
        high = min(j + step, size - 1)
    else:
        high = j
        while j - step >= 0 and peak[j - step] >= level:
            high, step = j - step, 2 * step
        low = max(j - step, 0)
    while low < high:
        middle = (low + high) // 2
        if peak[middle] < level:
            low = middle + 1
        else:
            high = middle
    return low
