"""Crossings of a quantised angle by its edges, with a standard uncertainty for every P(n).

Around every crossing xi is fitted to the angle,

    xi_i = a + b (theta_i - level) + c (theta_i - level)^2 + e_i,     xi(level) = a

by least squares over the samples within a sixteenth of a turn. Where the angle stands still in many samples (fewer
counts than samples), the edges of the counts are taken instead: there the angle is known, and xi lies between the
samples before and after.

    u^2(a) = u_q^2 + s^2 (M^-1)_11,     u^2(P) = u^2(a_n) + u^2(a_(n-1))

u_q is what the quantisation of the angle does. Of a motion so even that the errors of neighbours go together, it is
found by repeating the fit on the smooth motion, quantised anew with the counts shifted by eighths; of a motion so
uneven that they are independent, u_q^2 = b^2 w^2 / 12 (M^-1)_11, w the width of a count, or of a sample where edges
are taken. Real spindles lie between: the mean of both variances is taken. s^2 is the variance of the residuals of all
crossings together, less what quantisation explains of it: noise of the position, jitter, instants of sampling. M is
the normal matrix. The windows of two crossings of a start angle have no sample in common.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.pitch.recorded import pitch_table
from threadpitch.pitch.table import PitchError, PitchTable
from threadpitch.trace import TURN, FloatArray, Trace

WINDOW = TURN / 16.0  # rad on either side of a crossing; the feed's error is nearly a parabola in there
LEAST = 6  # observations in a window
PHASES = 8  # of the counts, over which the effect of quantisation is taken
_MOST = 2000  # samples on either side
_STANDING = 0.3  # share of samples that repeat the angle, from which on the edges are taken
_WHOLE = 0.05  # of a count, by which steps may differ from whole counts
_LOOKED_AT = 10_000  # samples, for the count
_TRIED = 100  # counts
_SMALLEST = 1e-5  # rad, of a count that matters


@dataclass(frozen=True, eq=False)
class _Fit:
    """The parabola about a level."""

    coefficients: FloatArray  # (3,) m, of 1, theta / WINDOW and its square
    weight: float  # (M^-1)_11
    squares: float  # m2, sum of the squares of the residuals
    freedom: int
    samples: bool  # the observations are all samples


@dataclass(frozen=True)
class _Crossing:
    """xi at a level, and what its uncertainty is made of."""

    position: float  # m
    quantisation: float  # m2, variance of the position by the counts
    weight: float
    squares: float  # m2, of the residuals, less what quantisation explains
    freedom: int


def edge_pitch_table(trace: Trace, start_angles: ArrayLike | None = (0.0,)) -> PitchTable:
    """``pitch_table`` with crossings by the edges, and with ``PitchTable.uncertainty``.

    A crossing that has fewer than ``LEAST`` observations around it, or on one side only, is NaN.

    Raises:
        PitchError: as ``pitch_table``; there are too few observations for a single turn.
    """
    linear = pitch_table(trace, start_angles)
    levels = linear.start_angles[:, np.newaxis] + TURN * (linear.turns_before + np.arange(linear.crossings.shape[1]))
    count = trace.resolution or _count_of(trace.angle)
    rising = np.maximum.accumulate(trace.angle)
    crossings, variances, weights = (np.full(levels.shape, np.nan) for _ in range(3))
    squares, freedom = 0.0, 0
    for place in zip(*np.nonzero(~np.isnan(linear.crossings)), strict=True):
        found = _crossing(trace, rising, float(levels[place]), count)
        if found is not None:
            crossings[place], variances[place], weights[place] = found.position, found.quantisation, found.weight
            squares, freedom = squares + found.squares, freedom + found.freedom
    if np.isnan(np.diff(crossings, axis=1)).all():
        raise PitchError(f"{trace.whole()}: too few samples or counts per turn for crossings by edges; take "
                         "linear ones")
    variances += max(squares / freedom, 0.0) * weights
    direction = np.sign(np.nansum(linear.pitch * np.diff(linear.crossings, axis=1))) or 1.0
    note = "crossings by the edges of the angle's counts, with the standard uncertainty of every P(n)"
    return replace(
        linear,
        pitch=direction * np.diff(crossings, axis=1) + 0.0,
        crossings=crossings,
        extrapolated=np.zeros_like(linear.extrapolated),
        uncertainty=np.sqrt(variances[:, 1:] + variances[:, :-1]),
        notes=(*linear.notes, note),
    )


def _count_of(angle: FloatArray) -> float:
    """The count of a quantised angle, rad: the largest of which all steps are multiples; 0 for none."""
    steps = np.abs(np.diff(angle[:_LOOKED_AT]))
    sizes = np.unique(np.round(steps, 6))
    for count in np.unique(np.diff(sizes))[::-1][:_TRIED]:
        multiples = steps / count
        if count > _SMALLEST and np.mean(np.abs(multiples - np.rint(multiples)) < _WHOLE) > 0.99:
            return float(count)
    return 0.0


def _crossing(trace: Trace, rising: FloatArray, level: float, count: float) -> _Crossing | None:
    middle, first, last = (int(np.searchsorted(rising, level + side * WINDOW)) for side in (0.0, -1.0, 1.0))
    part = slice(max(first, middle - _MOST), min(last, middle + _MOST))
    theta, xi = trace.angle[part] - level, trace.position[part]
    if theta.size < LEAST:
        return None
    origin = float(xi[0])
    fit = _fitted(theta, xi - origin)
    if fit is None:
        return None
    position = origin + float(fit.coefficients[0])
    if count == 0.0:
        return _Crossing(position, 0.0, fit.weight, fit.squares, fit.freedom)
    variance, explained = _by_quantisation(theta, fit, count)
    width = count if fit.samples else (theta[-1] - theta[0]) / (theta.size - 1)
    independent = (float(fit.coefficients[1]) / WINDOW * width) ** 2 / 12.0
    return _Crossing(position, 0.5 * (variance + independent * fit.weight), fit.weight,
                     fit.squares - 0.5 * (explained + independent * fit.freedom), fit.freedom)


def _fitted(theta: FloatArray, xi: FloatArray) -> _Fit | None:
    """The parabola through the observations that samples give; theta from the level."""
    size = theta.size
    theta, xi = _observations(theta, xi)
    if theta.size < LEAST or not theta[0] <= 0.0 <= theta[-1]:
        return None
    matrix = _powers(theta)
    inverse = np.linalg.pinv(matrix.T @ matrix)
    coefficients = inverse @ (matrix.T @ xi)
    residuals = xi - matrix @ coefficients
    return _Fit(coefficients, float(inverse[0, 0]), float(residuals @ residuals), theta.size - 3, theta.size == size)


def _observations(theta: FloatArray, xi: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The samples; or, where the angle mostly stands still, the edges at which it rises above its peak."""
    peak = np.maximum.accumulate(theta)
    rises = np.diff(peak)
    edges = np.flatnonzero(rises > 0.0)
    if edges.size == 0 or edges.size >= (1.0 - _STANDING) * rises.size:
        return theta, xi
    count = float(np.median(rises[edges]))
    first = np.minimum(peak[edges] + count, peak[edges + 1])  # the first of the edges between two samples
    return 0.5 * (first + peak[edges + 1]), 0.5 * (xi[edges] + xi[edges + 1])


def _by_quantisation(theta: FloatArray, fit: _Fit, count: float) -> tuple[float, float]:
    """(variance of xi at the level, m2; mean sum of the squares of the residuals, m2) over phases of the counts."""
    steps = np.linspace(-1.0, 1.0, theta.size)
    smooth = np.polynomial.Polynomial.fit(steps, theta, 3)(steps)
    xi = _powers(smooth) @ fit.coefficients
    found, squares = [], []
    for phase in (np.arange(PHASES) + 0.5) / PHASES:
        again = _fitted((np.floor(smooth / count + phase) - phase) * count, xi)
        if again is not None:
            found.append(again.coefficients[0])
            squares.append(again.squares)
    return (float(np.var(found)), float(np.mean(squares))) if found else (0.0, 0.0)


def _powers(theta: FloatArray) -> FloatArray:
    return np.vander(theta / WINDOW, 3, increasing=True)
